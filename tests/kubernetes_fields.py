"""What is lost of a Kubernetes manifest on the way through the API."""


def lost_fields(written, read, path=""):
    """Fields of `written`, what YAML or JSON holds, that `read` does not have or has otherwise."""
    if isinstance(written, dict):
        if not isinstance(read, dict):
            return [path]
        return [lost for key, value in written.items()
                for lost in (lost_fields(value, read[key], f"{path}.{key}")
                             if key in read else [f"{path}.{key}"])]
    if isinstance(written, list):
        if not isinstance(read, list) or len(read) != len(written):
            return [path]
        return [lost for i, (a, b) in enumerate(zip(written, read))
                for lost in lost_fields(a, b, f"{path}[{i}]")]
    return [] if written == read else [path]
