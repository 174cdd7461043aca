"""What several commands share: parsing, printing, checks of files, scenes that are set up."""
