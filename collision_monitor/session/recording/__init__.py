"""From messages to session files."""
