"""Commands for the first hour with vestige."""
