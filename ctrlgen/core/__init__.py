"""What everything else stands on: units at the border, errors, files in and out, parallel work."""
