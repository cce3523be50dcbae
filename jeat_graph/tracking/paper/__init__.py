"""The paper's method to the letter, in NumPy: the engine `paper`."""
