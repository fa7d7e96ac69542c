"""The foundation of all packages: units, errors, files in and out, parallel work, results as JSON."""
