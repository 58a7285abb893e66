"""Free motion without sustained forcing: decay, growth from rest, response to a single event."""
