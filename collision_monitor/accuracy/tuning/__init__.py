"""The cheapest settings that meet demands on a recording."""
