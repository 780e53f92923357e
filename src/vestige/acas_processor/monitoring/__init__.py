"""Receiver state between epochs, and the budget of false alarms."""
