"""Networks from ONNX files: what they want, what they say, and how they are run."""
