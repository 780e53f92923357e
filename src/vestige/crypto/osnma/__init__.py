"""OSNMA: from pages to validated keys and verified tags."""
