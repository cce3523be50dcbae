"""The SEHN data set: protocol, files and their verification."""
