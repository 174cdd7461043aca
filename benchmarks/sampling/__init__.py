"""How well conditions are made true."""
