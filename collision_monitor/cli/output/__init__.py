"""What commands print and write: tables, progress, errors, files."""
