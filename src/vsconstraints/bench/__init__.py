"""Many runs: drawn scenes, campaigns, test set, statistics, tuning, advice, learned laws."""
