"""What every node has: process, parameters, quality of service, diagnostics."""
