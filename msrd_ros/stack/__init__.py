"""Starting and watching nodes as processes of their own."""
