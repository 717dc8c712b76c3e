"""The base of every node: process, parameters, quality of service, diagnostics."""
