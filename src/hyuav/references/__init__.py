"""The exact optimum and the fixed flights that learned policies are compared with."""
