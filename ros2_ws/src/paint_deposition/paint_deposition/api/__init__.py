"""The verbs of the public interface; the command line goes through them as well."""
