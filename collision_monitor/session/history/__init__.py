"""What happened in a session, and tests of it."""
