"""How what a user gives is checked: by the types and ranges that fields and parameters declare."""
