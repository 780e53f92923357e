"""What the receiver remembers between epochs, and what its alarms cost."""
