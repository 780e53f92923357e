"""Keep the receiver's state between blocks of epochs, and divide the budget of false alarms among the checks."""
