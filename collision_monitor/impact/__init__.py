"""When two bodies first meet, and their contact now."""
