"""What is touched: the beam's physics, the wire, the link to the device and its simulator."""
