"""The messages of OSNMA, field by field."""
