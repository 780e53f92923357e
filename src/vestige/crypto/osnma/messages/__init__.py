"""Parse, write and verify the messages of OSNMA."""
