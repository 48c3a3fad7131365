"""The panes of the cockpit, a module each."""
