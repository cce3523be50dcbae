"""Reading and writing: one file a format, in rooms by what is in the file."""
