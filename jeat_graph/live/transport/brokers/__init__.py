"""The brokers that messages come from and go to, one file with one record each."""
