"""What came out: loading, statistics, sensitivities, predictions, reports and exports."""
