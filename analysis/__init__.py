"""What came out: loading, statistics, predictions and reports."""
