"""Who is who, decided once more when the future is known."""
