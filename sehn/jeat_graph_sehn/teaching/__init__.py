"""A detector learns from the tracks of its own road: labels that the tracker made, without any by hand.

`labels`, `dividing`, `own_picture`, `lesson` and `exporting` need no PyTorch; `learning_from` does.
"""
