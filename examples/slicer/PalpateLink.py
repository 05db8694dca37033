"""Scripted module of 3D Slicer: press on a segment with a transform.

NOT VERIFIED IN SLICER: the protocol is tested, the user interface is not.

Add the folder of this file under Edit > Application Settings > Modules > Additional module paths, and install the
extension SlicerIGT (OpenIGTLinkIF). Choose a segmentation, a segment and a linear transform: Start exports the segment
as a surface, runs ``palpate run`` as a process of its own, and connects. The transform moves the tool; force and
contact appear in the module and in the scene. Slicer's thread never waits: it reads what the process has printed when a
timer fires, and what OpenIGTLinkIF has received.
"""

import json
import os

import qt
import slicer
from slicer.ScriptedLoadableModule import (
    ScriptedLoadableModule,
    ScriptedLoadableModuleLogic,
    ScriptedLoadableModuleWidget,
)

PORT = 18944


class PalpateLink(ScriptedLoadableModule):
    """What Slicer lists."""

    def __init__(self, parent):
        ScriptedLoadableModule.__init__(self, parent)
        parent.title = "Palpate"
        parent.categories = ["IGT"]
        parent.dependencies = ["OpenIGTLinkIF"]
        parent.helpText = "Press on a segment and feel the force (not verified in Slicer)."


class PalpateLinkWidget(ScriptedLoadableModuleWidget):
    """Choosers, a button, and the force."""

    def setup(self):
        """Build the panel."""
        ScriptedLoadableModuleWidget.setup(self)
        form = qt.QFormLayout()
        self.layout.addLayout(form)
        self.chooser = self._chooser("vtkMRMLSegmentationNode")
        self.transform = self._chooser("vtkMRMLLinearTransformNode")
        self.stiffness = qt.QLineEdit("10kPa")
        self.command = qt.QLineEdit("palpate")
        self.force = qt.QLabel("not running")
        self.button = qt.QPushButton("Start")
        form.addRow("Segmentation", self.chooser)
        form.addRow("Tool transform", self.transform)
        form.addRow("Young's modulus", self.stiffness)
        form.addRow("Command", self.command)
        form.addRow("Force", self.force)
        self.layout.addWidget(self.button)
        self.layout.addStretch(1)
        self.button.clicked.connect(self.toggle)
        self.logic = PalpateLinkLogic()
        self.timer = qt.QTimer()
        self.timer.setInterval(50)
        self.timer.timeout.connect(lambda: self.force.setText(self.logic.force_text()))

    def _chooser(self, kind):
        chooser = slicer.qMRMLNodeComboBox()
        chooser.nodeTypes = [kind]
        chooser.setMRMLScene(slicer.mrmlScene)
        return chooser

    def toggle(self):
        """Start, or stop."""
        if self.logic.is_running():
            self.logic.stop()
            self.timer.stop()
            self.button.text, self.force.text = "Start", "not running"
            return
        try:
            self.logic.start(
                self.chooser.currentNode(), self.transform.currentNode(), self.command.text, self.stiffness.text
            )
        except RuntimeError as error:
            slicer.util.errorDisplay(str(error))
            return
        self.timer.start()
        self.button.text = "Stop"

    def cleanup(self):
        """Leave no process behind."""
        self.timer.stop()
        self.logic.stop()


class PalpateLinkLogic(ScriptedLoadableModuleLogic):
    """The process and the connection."""

    def __init__(self):
        ScriptedLoadableModuleLogic.__init__(self)
        self.process, self.connector, self.transform = None, None, None

    def is_running(self):
        """Whether the process has not ended."""
        return self.process is not None and self.process.state() != qt.QProcess.NotRunning

    def start(self, segmentation, transform, command, stiffness):
        """Export the first segment in mm and RAS, start the process, connect."""
        if segmentation is None or transform is None:
            raise RuntimeError("Choose a segmentation and a linear transform.")
        folder = slicer.app.temporaryPath
        ids = segmentation.GetSegmentation().GetSegmentIDs()
        if not ids:
            raise RuntimeError("The segmentation has no segment.")
        slicer.modules.segmentations.logic().ExportSegmentsClosedSurfaceRepresentationToFiles(
            folder, segmentation, None, "STL", True, 1.0, False
        )
        name = segmentation.GetSegmentation().GetSegment(ids[0]).GetName()
        surface = os.path.join(folder, f"{segmentation.GetName()}_{name}.stl")
        self.process = qt.QProcess()
        words = ["run", surface, "--unit", "mm", "-E", stiffness, "--igtl", str(PORT), "--no-browser"]
        self.process.start(command, words)
        self.connector = slicer.vtkMRMLIGTLConnectorNode()
        slicer.mrmlScene.AddNode(self.connector)
        # The connector calls again until Palpate listens: the first computation takes seconds.
        self.connector.SetTypeClient("127.0.0.1", PORT)
        self.transform = transform
        transform.SetName("Tool")
        self.connector.RegisterOutgoingMRMLNode(transform)
        self.connector.Start()

    def force_text(self):
        """Force and fault of the latest message."""
        if not self.is_running():
            output = bytes(self.process.readAllStandardError()).decode(errors="replace") if self.process else ""
            return output.strip() or "not running"
        node = slicer.mrmlScene.GetFirstNodeByName("Force")
        if node is None:
            return "preparing"
        state = json.loads(node.GetText())
        x, y, z = state["force_N"][0]
        return state["fault"] or f"{(x * x + y * y + z * z) ** 0.5:.3f} N"

    def stop(self):
        """End the connection and the process."""
        if self.connector is not None:
            self.connector.Stop()
            slicer.mrmlScene.RemoveNode(self.connector)
            self.connector = None
        if self.process is not None:
            self.process.terminate()
            self.process = None
