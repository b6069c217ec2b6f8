"""One file a message type: its bytes in, objects and states out."""
