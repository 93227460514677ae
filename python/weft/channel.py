"""Connections to weft's programs: addresses, TLS folders, what to say when nobody answers."""

import os
import re
import socket
import ssl
import stat

import grpc

from . import errors

DEFAULT_COORDINATOR = "127.0.0.1:7411"
DEFAULT_NODE = "127.0.0.1:7412"
_MESSAGE_LIMIT = 64 << 20


def _mistake_in_address(address):
    def mistake(what):
        return (f"'{address}' is not an address: {what}; write host:port, like 127.0.0.1:7411, or "
                "unix:/path")
    if address.startswith("unix:"):
        return "" if len(address) > 5 else mistake("no path follows unix:")
    host, colon, port = address.rpartition(":")
    if not colon or not host:
        return mistake("it has no port")
    if not re.fullmatch(r"[0-9]{1,5}", port) or not 1 <= int(port) <= 65535:
        return mistake("its port is not a number from 1 to 65535")
    return ""


def _is_local(address):
    return address.startswith(("unix:", "127.", "localhost:", "[::1]:"))


def _read(path):
    try:
        with open(path, "rb") as file:
            return file.read()
    except OSError:
        raise errors.NotFound(
            f"cannot read {path}; a folder for --tls-folder has cert.pem, key.pem and ca.pem and is "
            "written by 'weft certs issue NAME --role ROLE'") from None


class Endpoint:
    """Where a program listens, and how to talk to it; the flags of the command line by its names."""

    def __init__(self, address, tls_folder=None, insecure=False):
        self.address = address
        self.tls_folder = os.environ.get("WEFT_TLS_FOLDER", "") if tls_folder is None else tls_folder
        self.insecure = insecure

    def open(self):
        """A gRPC channel. Raises InvalidArgument, NotFound or PermissionDenied."""
        mistake = _mistake_in_address(self.address)
        if mistake:
            raise errors.InvalidArgument(mistake)
        if not self.tls_folder and not self.insecure and not _is_local(self.address):
            raise errors.PermissionDenied(
                f"{self.address} is on another machine, and without TLS everyone in between can read "
                "and change what is said; name the folder that 'weft certs issue' wrote with "
                "--tls-folder or WEFT_TLS_FOLDER, or say --insecure in a network that you trust")
        options = [
            ("grpc.max_receive_message_length", _MESSAGE_LIMIT),
            ("grpc.max_send_message_length", _MESSAGE_LIMIT),
            ("grpc.enable_http_proxy", 0),
            ("grpc.keepalive_time_ms", 20_000),
            ("grpc.keepalive_timeout_ms", 10_000),
            ("grpc.http2.max_pings_without_data", 0),
        ]
        if not self.tls_folder:
            return grpc.insecure_channel(self.address, options)
        return grpc.secure_channel(self.address, self._credentials(), options)

    def _credentials(self):
        paths = {name: os.path.join(self.tls_folder, name) for name in ("cert.pem", "ca.pem", "key.pem")}
        texts = {name: _read(path) for name, path in paths.items()}
        if os.stat(paths["key.pem"]).st_mode & (stat.S_IRWXG | stat.S_IRWXO):
            raise errors.PermissionDenied(
                f"others may read the key {paths['key.pem']}; say 'chmod 600 {paths['key.pem']}', and "
                "issue the certificate anew if they have")
        return grpc.ssl_channel_credentials(texts["ca.pem"], texts["key.pem"], texts["cert.pem"])

    def tls_problem(self):
        """Why nothing answers, when TLS is why; else empty."""
        try:
            with self._connect() as connection:
                context = ssl.create_default_context()
                if self.tls_folder:
                    context = ssl.create_default_context(
                        cafile=os.path.join(self.tls_folder, "ca.pem"))
                    context.load_cert_chain(os.path.join(self.tls_folder, "cert.pem"),
                                            os.path.join(self.tls_folder, "key.pem"))
                else:
                    context.check_hostname = False
                    context.verify_mode = ssl.CERT_NONE
                host = self.address.rpartition(":")[0].strip("[]")
                context.set_alpn_protocols(["h2"])
                with context.wrap_socket(connection, server_hostname=host):
                    pass
        except ssl.SSLCertVerificationError as error:
            return (f"{self.address} shows a certificate that is not of your cluster or not for its "
                    f"name ({error.verify_message})")
        except (OSError, ValueError):
            return ""
        if self.tls_folder:
            return ""
        return (f"what answers at {self.address} speaks TLS; name the folder that 'weft certs issue' "
                "wrote for you with --tls-folder or WEFT_TLS_FOLDER")

    def _connect(self):
        seconds = 5
        if self.address.startswith("unix:"):
            connection = socket.socket(socket.AF_UNIX)
            connection.settimeout(seconds)
            connection.connect(self.address[5:].removeprefix("//"))
            return connection
        host, _, port = self.address.rpartition(":")
        return socket.create_connection((host.strip("[]"), int(port)), timeout=seconds)


class Connection:
    """A channel to the program that listens at an address; `with` closes it."""

    def __init__(self, address, tls_folder, insecure):
        self._endpoint = Endpoint(address, tls_folder, insecure)
        self._channel = self._endpoint.open()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def close(self):
        self._channel.close()
