"""What is judged and what is ignored: one module with one record each; `registry` finds them."""
