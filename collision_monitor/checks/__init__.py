"""What a user, a file or a message may give: each check returns it, or says what was expected and what was there."""
