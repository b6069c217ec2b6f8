"""The contacts of a step: plain, carried over, their features and their patches."""
