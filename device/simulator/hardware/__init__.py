"""What is inside the simulated device: power stage, beam, finger and sensors."""
