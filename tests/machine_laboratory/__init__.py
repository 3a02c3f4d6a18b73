"""A laboratory of machines with an unknown spindle; only the commands use the library."""
