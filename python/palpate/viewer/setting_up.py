"""Bodies that are set up in the page: files from the page in control, choices, and the loop that touches the body.

A file comes with its name and size first, then with its bytes in parts.
"""

from __future__ import annotations

import asyncio
import re
import shlex
import shutil
import tempfile
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from dataclasses import asdict
from pathlib import Path
from typing import Any

from palpate.body.tissues import TISSUES, Tissue
from palpate.errors import Error, ViewerError
from palpate.mesh import TetMesh
from palpate.mesh.files import WRITERS
from palpate.mesh.fill_process import FillProcess, ReadFile
from palpate.mesh.surface_file import SURFACE_ENDINGS
from palpate.scene import Scene
from palpate.scene.build import unsolved_body
from palpate.scene.regions import TouchTable
from palpate.scene.sizes import Expected
from palpate.segmentation.endings import SEGMENTATION_ENDINGS
from palpate.viewer.computing import mask_of
from palpate.viewer.messages import whole
from palpate.viewer.session import Session
from palpate.viewer.session_host import SessionHost
from palpate.viewer.setup_body import SetupBody
from palpate.viewer.setup_session import SetupSession
from palpate.viewer.status import CancellableTask, error_message, status

# Endings of the files that a page may send: surfaces, segmentations, and volume meshes that are one file.
ENDINGS = (*SURFACE_ENDINGS, *SEGMENTATION_ENDINGS, *(ending for ending in WRITERS if ending not in {".node", ".ele"}))
# A binary STL of four million triangles has 200 MB.
MAX_FILE = 200_000_000
# Bytes of a part: one message, which the server answers before the next comes.
MAX_PART = 262_144
# Bytes of a name; file systems take 255.
LONGEST_NAME = 120
# Where a mistake stands in a scene file: path, line, and table.
_PLACE = re.compile(r"^\S.*?\.toml(:\d+)?: (\w+: )?")


class Upload:
    """A file on its way into a folder; ViewerError if it is announced as too large, or of an unknown kind."""

    def __init__(self, message: Mapping[str, Any], folder: Path):
        self.file = safe_name(message.get("name"))
        if not self.file.lower().endswith(ENDINGS):
            raise ViewerError(_wrong_kind(self.file))
        if isinstance(message.get("size"), int) and message["size"] > MAX_FILE:
            size, most = min(message["size"], 10**15) // 10**6, MAX_FILE // 10**6
            raise ViewerError(f"{self.file} has {size} MB: the page takes files up to {most} MB")
        self.size = whole(message, "size", 1, MAX_FILE)
        self.folder, self.received = folder, 0
        self._output = (folder / self.file).open("wb")

    @property
    def is_complete(self) -> bool:
        """Whether all bytes have come."""
        return self.received == self.size

    def take(self, part: bytes) -> None:
        """Take the next part; ViewerError for more than was announced, or a disk that is full."""
        if self.received + len(part) > self.size or not part:
            self.close()
            raise ViewerError(f"{self.file}: its parts do not come to {self.size} bytes")
        try:
            self._output.write(part)
            self.received += len(part)
            if self.is_complete:
                self._output.close()
        except OSError as error:
            self.close()
            raise ViewerError(f"{self.file}: cannot be kept: {error.strerror or error}") from None

    def close(self) -> None:
        """Give up what has come."""
        self._output.close()


def safe_name(name: Any) -> str:
    """Name of a file without a folder, and without characters that a file system or a terminal may not take.

    Raises ViewerError for what is no name.
    """
    if not isinstance(name, str) or len(name.encode("utf-8", "replace")) > LONGEST_NAME:
        raise ViewerError(f"upload: name must be a text of at most {LONGEST_NAME} bytes")
    safe = re.sub(r"[^\w. -]", "_", name).strip(". ")
    if not Path(safe).stem.strip(". _"):
        raise ViewerError("upload: the file needs a name")
    return safe


def _wrong_kind(file: str) -> str:
    ending = Path(file).suffix.lower()
    if ending in {".toml", ".palpate"}:
        return f"{file}: scenes and stores are opened where they lie: palpate run {shlex.quote(str(file))}"
    return f"{file}: no surface, mesh or segmentation by its ending; the page takes {', '.join(ENDINGS)}"


class SettingUp:
    """The body that is set up, its files, and what pages ask of it; scenes are saved in ``folder``."""

    def __init__(self, server: SessionHost, folder: Path):
        self._server, self._folder = server, folder
        self._temporary: Path | None = None
        self._count = 0
        self._upload: Upload | None = None
        self._body: SetupBody | None = None
        # The session in which the body is touched.
        self._touched: Session | None = None
        self._commands = {
            "upload": self._begin_upload,
            "setup": self._choose,
            "hold": self._paint,
            "touch": self._touch,
            "edit": self._edit,
            "save": self._save,
        }

    @property
    def kinds(self) -> frozenset[str]:
        """Types of the messages that this takes."""
        return frozenset(self._commands)

    async def command(self, message: Mapping[str, Any]) -> None:
        """Do what the page in control asks for; Error for what makes no sense, or cannot be done now."""
        if not self._server.session.takes_files:
            raise ViewerError("no body can be set up here")
        try:
            await self._commands[message["type"]](message)
        except Exception:
            # The page has shown its choice already.
            self._server.send_control(self.message())
            raise

    @property
    def is_offered(self) -> bool:
        """Whether pages hear of it: an exam and a replay have no place for it."""
        session = self._server.session
        return session.takes_files or isinstance(session, SetupSession)

    def message(self) -> dict[str, Any]:
        """Message with all that pages show of the body that is set up."""
        session = self._server.session
        editing = isinstance(session, SetupSession) and session.takes_files
        touching = session is self._touched
        return {
            "type": "setup",
            "limit": MAX_FILE if session.takes_files else 0,
            "part": MAX_PART,
            "endings": list(ENDINGS),
            "tissues": [_tissue_message(tissue) for tissue in TISSUES],
            "editing": editing,
            "preparing": isinstance(session, SetupSession) and not editing,
            "body": self._body.message() if self._body is not None and (editing or touching) else None,
        }

    def close(self) -> None:
        """Delete what has come and what was made of it; saved scenes stay."""
        self.drop_upload()
        if self._temporary is not None:
            shutil.rmtree(self._temporary, ignore_errors=True)

    def drop_upload(self) -> None:
        """Give up a file on its way: the page that sends it is gone."""
        if self._upload is not None:
            self._upload.close()
            shutil.rmtree(self._upload.folder, ignore_errors=True)
            self._upload = None

    def note_exchange(self, before: Session, session: Session) -> None:
        """Take a session on the same bodies for the one before."""
        if self._touched is before:
            self._touched = session

    # Files.

    async def _begin_upload(self, message: Mapping[str, Any]) -> None:
        self.drop_upload()
        try:
            if self._temporary is None:
                self._temporary = Path(tempfile.mkdtemp(prefix="palpate-page-"))
            self._count += 1
            folder = self._temporary / str(self._count)
            folder.mkdir()
            self._upload = Upload(message, folder)
        except OSError as error:
            raise ViewerError(f"upload: the file cannot be kept: {error.strerror or error}") from None
        self._server.send_control({"type": "uploaded", "bytes": 0})

    async def take_part(self, part: bytes) -> None:
        """Take the next part of a file; ViewerError for a part that was not announced."""
        upload = self._upload
        if upload is None:
            raise ViewerError("upload: announce a file before its parts")
        try:
            await self._server.call(upload.take, part)
        except ViewerError:
            self.drop_upload()
            raise
        if upload.is_complete:
            self._upload = None
            building = self._server.begin_building()
            self._server.work(self._fill(upload.folder, upload.file, building))
        self._server.send_control({"type": "uploaded", "bytes": upload.received})

    async def _fill(self, folder: Path, file: str, building: CancellableTask) -> None:
        """Read and fill a file; what was shown before comes back where that fails."""
        server, loop = self._server, asyncio.get_running_loop()
        before, body_before = server.session, self._body
        drawn: list[Future[None]] = []
        report = server.reporter(file, building)

        def on_read(read: ReadFile) -> None:
            drawn.append(asyncio.run_coroutine_threadsafe(self._show(SetupBody(read, folder), building), loop))

        def on_stage(name: str, done: int, total: int) -> None:
            report.phase(name)
            report(done, total)

        process = FillProcess(folder, file, None, on_read, on_stage)
        try:
            server.send_all(status(f"{file}: reading"))
            mesh: TetMesh = await building.run(lambda: process.mesh(building.require_wanted), lambda _: None)
            for shown in drawn:
                await asyncio.wrap_future(shown)
            assert self._body is not None
            self._body.take_mesh(mesh, process.notes)
            await server.call(server.replace, SetupSession(self._body))
        except Exception as error:
            server.send_all(error_message(error))
            # What is still to be drawn would take the place of what comes back.
            building.cancel()
            await asyncio.gather(*map(asyncio.wrap_future, drawn), return_exceptions=True)
            self._body = body_before
            if server.session is not before:
                await server.call(server.restore, before)
            shutil.rmtree(folder, ignore_errors=True)
        finally:
            server.finish_building()
            server.send_all(self.message())

    async def _show(self, body: SetupBody, building: CancellableTask) -> None:
        """Draw a surface before it is filled."""
        if building.is_cancelled:
            return
        self._body = body
        if body.read.vertices is not None:
            await self._server.call(self._server.exchange, SetupSession(body))
            self._server.send_all(self.message())

    # Choices.

    async def _choose(self, message: Mapping[str, Any]) -> None:
        body = self._edited()
        if await self._server.call(body.change, message):
            await self._server.call(self._server.exchange, SetupSession(body))
            self._server.send_control(self.message())
        self._server.send_all(self.message(), but_control=True)

    async def _paint(self, message: Mapping[str, Any]) -> None:
        body = self._edited()
        first = whole(message, "first", 0, max(0, len(body.mesh.surface_nodes) - 1) if body.mesh is not None else 0)
        await self._server.call(body.paint, first, mask_of(message, "nodes"))
        self._server.send_all(self.message(), but_control=True)

    def _edited(self) -> SetupBody:
        """Body that is set up now."""
        self._server.require_idle()
        if self._body is None or not isinstance(self._server.session, SetupSession):
            raise ViewerError("there is no body to be set up: drop a file on the page")
        return self._body

    # The loop.

    async def _touch(self, _message: Mapping[str, Any]) -> None:
        body, server = self._edited(), self._server
        scene = await server.call(body.scene)
        building = server.begin_building()
        columns = server.reporter(body.name, building)

        def make() -> Session:
            try:
                built, growing = _with_first(scene).build_first(columns)
                session = Session(built, folder=self._folder)
                session.growing = growing
                return session
            except Error as error:
                # The line of a file that nobody has written is of no use.
                raise type(error)(_PLACE.sub("", str(error))) from None

        server.work(self._switch_and_tell(f"{body.name}: assembling", make, building))

    async def _switch_and_tell(self, text: str, make: Callable[[], Session], building: CancellableTask) -> None:
        def exchange(session: Session) -> None:
            self._server.replace(session)
            self._touched = session

        await self._server.switch(text, make, exchange, building)
        self._server.send_all(self.message())

    async def _edit(self, _message: Mapping[str, Any]) -> None:
        self._server.require_idle()
        body = self._body
        if body is None or self._server.session is not self._touched:
            raise ViewerError("what is shown was not set up in the page")
        await self._server.call(self._take_settings)
        await self._server.call(self._server.replace, SetupSession(body))
        self._server.send_all(self.message())

    async def _save(self, _message: Mapping[str, Any]) -> None:
        body, server = self._body, self._server
        if body is None or not (isinstance(server.session, SetupSession) or server.session is self._touched):
            raise ViewerError("what is shown was not set up in the page")
        await server.call(self._take_settings)
        await server.call(body.save, self._folder)
        server.send_all(self.message())

    def _take_settings(self) -> None:
        """Keep what sliders have changed while the body is touched."""
        session = self._server.session
        if self._body is not None and isinstance(session, Session) and session is self._touched:
            settings = session.settings()
            self._body.take_settings(settings["youngs_modulus"][0], settings["friction"][0])


def _tissue_message(tissue: Tissue) -> dict[str, Any]:
    known = asdict(tissue)
    del known["checked"]
    return {**known, "source": tissue.citation}


def _with_first(scene: Scene) -> Scene:
    """Scene of which a part is computed first, where the whole takes long; its store is the same."""
    first = Expected.of(unsolved_body(scene)).first
    if first is None:
        return scene
    center, radius = first
    table = TouchTable.model_validate({"first": {"shape": "sphere", "center": center, "radius": radius}})
    return scene.model_copy(update={"touch": table})
