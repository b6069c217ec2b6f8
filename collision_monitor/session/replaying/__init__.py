"""From session files to the same answers again."""
