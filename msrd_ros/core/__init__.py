"""Words that every room shares: errors, parameters, resources, scratch folders. Imports nothing of ours."""
