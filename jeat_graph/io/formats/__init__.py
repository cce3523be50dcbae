"""File formats of boxes, one module with one record each; `registry` finds them."""
