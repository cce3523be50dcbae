"""Networks of our own that find vehicles in pictures and in events, and their training; needs PyTorch."""
