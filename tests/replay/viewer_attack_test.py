#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Attacks the viewer's server with raw sockets: everything is refused or harmless, and the server goes on."""
import base64
import json
import os
import pathlib
import socket
import struct
import subprocess
import sys
import tempfile
import time
import unittest
import urllib.parse

from viewer_page import BIN, WAIT_SECONDS, Viewer, simulate

SCHEMA = "raystage/viewer_message/1"


class Server(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = tempfile.TemporaryDirectory(prefix="raystage-attack-")
        cls.root = pathlib.Path(cls.folder.name)
        simulate(cls.root / "take")
        (cls.root / "secret").write_text("not for the viewer")
        cls.viewer = Viewer(cls.root / "take", "--max-viewers", "4")
        url = urllib.parse.urlparse(cls.viewer.url)
        cls.address, cls.host, cls.token = (url.hostname, url.port), url.netloc, url.path.strip("/")

    @classmethod
    def tearDownClass(cls) -> None:
        assert cls.viewer.end() == 0, "the server ended well"
        cls.folder.cleanup()

    def tearDown(self) -> None:
        """The server goes on."""
        self.assertIsNone(self.viewer.process.poll(), "the server has ended")
        self.assertEqual(self.status(self.get(f"/{self.token}/")), 200)

    def connect(self) -> socket.socket:
        connection = socket.create_connection(self.address, timeout=WAIT_SECONDS)
        self.addCleanup(connection.close)
        return connection

    def exchange(self, request: bytes) -> bytes:
        connection = self.connect()
        connection.sendall(request)
        answer = b""
        try:
            while part := connection.recv(65536):
                answer += part
        except ConnectionResetError:
            pass
        return answer

    def get(self, target: str, method: str = "GET", **headers: str) -> bytes:
        lines = {"Host": self.host, "Connection": "close", **{name.replace("_", "-"): value for name, value in headers.items()}}
        head = "".join(f"{name}: {value}\r\n" for name, value in lines.items() if value is not None)
        return self.exchange(f"{method} {target} HTTP/1.1\r\n{head}\r\n".encode())

    @staticmethod
    def status(answer: bytes) -> int:
        return int(answer.split(b" ", 2)[1]) if answer.startswith(b"HTTP/1.1 ") else 0

    # WebSockets.

    def upgrade(self, target: str = None, origin: str = "", host: str = None) -> tuple:
        connection = self.connect()
        origin_line = "" if origin is None else f"Origin: {origin or 'http://' + self.host}\r\n"
        connection.sendall((f"GET {target or f'/{self.token}/socket'} HTTP/1.1\r\nHost: {host or self.host}\r\n{origin_line}"
                            "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
                            f"Sec-WebSocket-Key: {base64.b64encode(os.urandom(16)).decode()}\r\n\r\n").encode())
        head = b""
        while not head.endswith(b"\r\n\r\n"):
            byte = connection.recv(1)
            if not byte:
                break
            head += byte
        return connection, self.status(head)

    def open_socket(self) -> socket.socket:
        for _ in range(100):  # the sockets of earlier tests may still be closing
            connection, status = self.upgrade()
            if status == 101:
                return connection
            time.sleep(0.05)
        self.fail(f"no socket: {status}")

    @staticmethod
    def frame(payload: bytes, opcode: int = 1, length: int = None, final: bool = True) -> bytes:
        length = len(payload) if length is None else length
        head = bytes([(0x80 if final else 0) | opcode])
        if length < 126:
            head += bytes([0x80 | length])
        elif length < 65536:
            head += bytes([0x80 | 126]) + struct.pack(">H", length)
        else:
            head += bytes([0x80 | 127]) + struct.pack(">Q", length)
        return head + bytes(4) + payload  # the mask is 0

    @staticmethod
    def read_frame(connection: socket.socket) -> tuple:
        def exactly(count: int) -> bytes:
            data = b""
            while len(data) < count:
                part = connection.recv(count - len(data))
                if not part:
                    raise EOFError
                data += part
            return data

        opcode, length = exactly(2)
        if length == 126:
            length = struct.unpack(">H", exactly(2))[0]
        elif length == 127:
            length = struct.unpack(">Q", exactly(8))[0]
        return opcode & 15, exactly(length)

    def texts(self, connection: socket.socket):
        while True:
            opcode, payload = self.read_frame(connection)
            if opcode == 1:
                yield json.loads(payload)

    def is_closed(self, connection: socket.socket) -> bool:
        try:
            while True:
                opcode, _ = self.read_frame(connection)
                if opcode == 8:
                    return True
        except (EOFError, ConnectionError):
            return True

    def test_pages_need_the_token(self) -> None:
        for target in ("/", "/index.html", "/socket", f"/{'0' * 32}/", f"/{self.token[:-1]}/", f"/{self.token}",
                       f"//{self.token}/", "*", f"/x/{self.token}/"):
            self.assertEqual(self.status(self.get(target)), 403, target)

    def test_other_hosts_and_origins_are_refused(self) -> None:
        page = f"/{self.token}/"
        for host in ("evil.example", f"evil.example:{self.address[1]}", "127.0.0.1", "", f"[::1]:{self.address[1]}"):
            self.assertEqual(self.status(self.get(page, Host=host)), 403, host)
        self.assertIn(self.status(self.get(page, Host=None)), (400, 403))
        for origin in ("http://evil.example", "null", f"https://{self.host}"):
            self.assertEqual(self.status(self.get(page, Origin=origin)), 403, origin)
            self.assertEqual(self.upgrade(origin=origin)[1], 403, origin)
        self.assertEqual(self.upgrade(origin=None)[1], 403)
        self.assertEqual(self.upgrade(host="evil.example")[1], 403)
        self.assertEqual(self.upgrade(target=f"/{'0' * 32}/socket")[1], 403)
        self.assertEqual(self.upgrade(target=f"/{self.token}/other")[1], 404)

    def test_paths_lead_nowhere_else(self) -> None:
        for path in ("../secret", "..%2fsecret", "%2e%2e/secret", "....//secret", "take/take.json", "/etc/passwd", "\\..\\secret",
                     "index.html/../../secret", "index.html%00.js"):
            answer = self.get(f"/{self.token}/{path}")
            self.assertIn(self.status(answer), (400, 404), path)
            self.assertNotIn(b"not for the viewer", answer)

    def test_pages_may_load_nothing_from_elsewhere(self) -> None:
        head = self.get(f"/{self.token}/").split(b"\r\n\r\n")[0].lower()
        for line in (b"content-security-policy: default-src 'none'", b"x-content-type-options: nosniff",
                     b"referrer-policy: no-referrer", b"frame-ancestors 'none'"):
            self.assertIn(line, head)

    def test_other_requests_are_refused(self) -> None:
        page = f"/{self.token}/"
        for method in ("POST", "PUT", "DELETE", "OPTIONS", "TRACE", "BREW"):
            self.assertIn(self.status(self.get(page, method)), (400, 405), method)
        self.assertIn(self.status(self.get(page, "POST", Content_Length="10000000000")), (0, 400, 413, 405))
        for garbage in (b"\0" * 100, b"GET\r\n\r\n", b"\x16\x03\x01" + os.urandom(200), b"GET / HTTP/9.9\r\n\r\n",
                        b"GET / HTTP/1.1\r\n" + b"X: " + b"a" * 100_000 + b"\r\n\r\n"):
            self.assertNotEqual(self.status(self.exchange(garbage)), 200)

    def test_giant_messages_end_the_connection(self) -> None:
        for message in (self.frame(b"", length=1 << 40), self.frame(b"x" * (5 << 20)),
                        self.frame(b"x" * 10, length=(1 << 63) + 1)):
            connection = self.open_socket()
            try:
                connection.sendall(message)
            except ConnectionError:
                pass
            self.assertTrue(self.is_closed(connection))
            connection.close()

    def test_many_fragments_are_one_giant_message(self) -> None:
        connection = self.open_socket()
        try:
            connection.sendall(self.frame(b"x" * (1 << 20), final=False))
            for _ in range(10):
                connection.sendall(self.frame(b"x" * (1 << 20), opcode=0, final=False))
        except ConnectionError:
            pass
        self.assertTrue(self.is_closed(connection))

    def test_torn_and_binary_messages_end_the_connection(self) -> None:
        for message in (self.frame(b"{\"schema\"", length=500), self.frame(b"\xff\xfe\xfd"), self.frame(b"{}", opcode=2),
                        self.frame(b"", opcode=5), b"\xff\xff\xff\xff"):
            connection = self.open_socket()
            connection.sendall(message)
            connection.shutdown(socket.SHUT_WR)
            self.assertTrue(self.is_closed(connection), message)
            connection.close()

    def test_messages_that_are_not_valid_are_answered(self) -> None:
        connection = self.open_socket()
        texts = self.texts(connection)
        messages = ["", "{", "[]", "null", "{}", '{"schema": "raystage/viewer_message/1"}', "[" * 100_000,
                    json.dumps({"schema": SCHEMA, "type": "view", "id": 1, "frame": 1, "width": 10 ** 9, "height": 1}),
                    json.dumps({"schema": SCHEMA, "type": "open", "id": 1, "file": "a\0b"})]
        for message in messages:
            connection.sendall(self.frame(message.encode()))
            answer = next(text for text in texts if text["type"] == "error")
            self.assertEqual(answer["id"], 1 if '"id": 1' in message else -1, message[:50])
        connection.close()

    def test_files_outside_of_the_folder_are_refused(self) -> None:
        connection = self.open_socket()
        texts = self.texts(connection)
        os.symlink("/etc", self.root / "link")
        self.addCleanup(os.unlink, self.root / "link")
        for number, file in enumerate(("../x.json", "/etc/passwd", "link/passwd", "take/../../x.json", "link/new.json"), 10):
            for members in ({"type": "open"}, {"type": "save", "text": "{}", "replace": True},
                            {"type": "snapshot", "frame": 1, "replace": True}):
                connection.sendall(self.frame(json.dumps({"schema": SCHEMA, "id": number, "file": file, **members}).encode()))
                answer = next(text for text in texts if text.get("id") == number)
                self.assertEqual(answer["type"], "error", (file, members))
                self.assertIn("outside", answer["what"])
        connection.close()

    def test_shots_of_pages_name_no_files_outside_of_the_folder(self) -> None:
        connection = self.open_socket()
        texts = self.texts(connection)
        shown = next(text for text in texts if text["type"] == "shot")
        shot = json.loads(shown["text"]) if isinstance(shown["text"], str) else shown["text"]
        with tempfile.TemporaryDirectory(prefix="raystage-outside-") as outside:
            (pathlib.Path(outside) / "take.json").write_text("TOPSECRET")
            os.symlink(outside, self.root / "lnk")
            self.addCleanup(os.unlink, self.root / "lnk")
            attacks = [{"take": take} for take in (outside, "/etc/passwd", "/no/such/folder", f"../{pathlib.Path(outside).name}", "lnk/../x")]
            attacks += [{"method": method, "options": {"proxy": "mesh", "mesh": "/etc/passwd"} if option == "mesh" else {option: "/etc/passwd"}}
                        for method, option in (("lumigraph", "mesh"), ("focal_plane", "objects"), ("aperture", "depth_map"))]
            for number, attack in enumerate(attacks, 10):
                changed = json.loads(json.dumps(shot))
                changed["layers"][0].update(attack)
                text = json.dumps(changed)
                view = {"type": "view", "frame": 1, "width": 64, "height": 48, "quality": "resting", "comparison": {"text": text}}
                for members in ({"type": "shot", "file": "x.json", "text": text}, {"type": "save", "file": "x.json", "text": text, "replace": True},
                                {"type": "autosave", "file": "x.json", "text": text}, view):
                    connection.sendall(self.frame(json.dumps({"schema": SCHEMA, "id": number, **members}).encode()))
                    answer = next(text for text in texts if text.get("id") == number and text["type"] == "error")
                    self.assertIn("outside of the viewer's folder", answer["what"], (attack, members["type"]))
                    self.assertNotIn("TOPSECRET", json.dumps(answer))
        self.assertFalse((self.root / "x.json").exists())
        connection.close()

    def test_more_viewers_than_allowed_are_refused(self) -> None:
        sockets = [self.open_socket() for _ in range(4)]
        self.assertEqual(self.upgrade()[1], 503)
        for connection in sockets:
            connection.close()
        self.open_socket().close()

    def test_a_client_that_never_reads_costs_bounded_memory(self) -> None:
        connection = self.open_socket()
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        view = {"schema": SCHEMA, "type": "view", "frame": 1, "width": 800, "height": 600, "quality": "moving"}
        connection.settimeout(1)
        peak = 0
        for number in range(1, 2000):
            try:
                connection.sendall(self.frame(json.dumps({**view, "id": number}).encode()))
            except (TimeoutError, ConnectionError):
                break
            if number % 100 == 0:
                peak = max(peak, self.resident_megabytes())
        self.assertLess(peak, 600)
        # Others are served meanwhile.
        other = self.open_socket()
        texts = self.texts(other)
        self.assertEqual(next(texts)["type"], "hello")
        self.assertEqual(next(texts)["type"], "shot")

    def resident_megabytes(self) -> float:
        # `raystage` runs the program in its own process.
        status = pathlib.Path(f"/proc/{self.viewer.process.pid}/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0]) / 1024

    def test_targets_that_cannot_be_shown_end_at_once(self) -> None:
        (self.root / "broken.json").write_text("{")
        for target, expected in (("broken.json", "broken.json:"), ("nowhere", "no such take")):
            ended = subprocess.run([str(BIN / "raystage"), "replay", str(self.root / target)], capture_output=True, text=True,
                                   timeout=WAIT_SECONDS)
            self.assertEqual(ended.returncode, 2, target)
            self.assertIn(expected, ended.stderr)

    def test_connections_that_send_nothing_do_not_keep_others_out(self) -> None:
        idle = [self.connect() for _ in range(200)]
        self.assertEqual(self.status(self.get(f"/{self.token}/")), 200)
        for connection in idle:
            connection.close()


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], "-v", *sys.argv[1:]])
