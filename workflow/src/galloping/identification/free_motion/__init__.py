"""Motion that nothing keeps up: free decay, growth from rest, what a single event sets off."""
