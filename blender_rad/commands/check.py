# SPDX-License-Identifier: GPL-3.0-or-later
"""``check``: does the witness's direct light agree with ours, and if not, which light is off?"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass, fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from ..atomic import write_text
from ..errors import Finding, RadError
from ..strict_json import dumps, plain
from . import _values as values
from ._base import Outcome, aligned, flag_of, option
from ._scene import PictureCommand

if TYPE_CHECKING:
    from ..arrays import Singles
    from ..bpy_io.witness import CyclesWitness
    from ..checking import Result
    from ..scene import Scene

TAKEN_BACK_SEEDS = 3
ASKED = "scene view_layer witness_scene render exposure witness_settings samples time_limit"
CODES = {"agree": 0, "undecided": 3, "differ": 1}  # exit codes, from the best to the worst


@dataclass(frozen=True, kw_only=True)
class CheckOptions(PictureCommand, verb="check"):
    """Say whether the direct light agrees with an independent engine, and why not."""

    report: Path | None = option(
        values.output_folder, "write the report into this folder, made if missing", metavar="DIR"
    )
    against: tuple[str, ...] = option(
        values.names("cycles", "radiance", "mitsuba"),
        "witnesses, with commas: cycles, radiance, mitsuba",
        default=("cycles",),
        metavar="LIST",
    )
    witness_scene: Path | None = option(
        values.scene_file, "render the witness from another file", metavar="OTHER.blend"
    )
    render: tuple[Path, ...] = option(
        values.exr_input,
        "judge pictures that exist (direct light only)",
        metavar="FILE.exr",
        several=True,
    )
    exposure: float | None = option(values.number(0), "film exposure of the pictures (default: 1)")
    witness_settings: Literal["reference", "file"] = option(
        values.choice("reference", "file"),
        "unbiased settings for the witness, or the file's own",
        default="reference",
    )
    tolerance: float = option(
        values.number(0, 1), "relative difference that is allowed", default=0.01
    )
    confidence: float = option(values.number(0.5, 1), "of the verdict", default=0.99)
    samples: int | None = option(
        values.integer(1), "a pixel, and a seed of the witness (default: more until decided)"
    )
    frames: tuple[int, int] | None = option(values.frame_range, "several frames, first and last")

    def __post_init__(self) -> None:
        super().__post_init__()
        self.exclude("frame", "frames")
        self.exclude("witness_scene", "render")
        self.require("exposure", "render")
        for picture in self.render:
            if self.report and picture.resolve().parent == self.report.resolve():
                where, expected = str(picture), "expected the report in another folder"
                raise RadError("the report would overwrite the picture", where, expected)

    def run(self) -> Outcome:
        if unknown := set(self.against) - {"cycles"}:
            listed = ", ".join(sorted(unknown))
            raise RadError(f"no such witness yet: {listed}", "--against", "expected cycles")
        if self.frames is None:
            document = self._one(self.frame, self.report)
            return Outcome(document, _table(document), CODES[document["verdict"]])
        documents: list[dict[str, Any]] = []
        for frame in range(self.frames[0], self.frames[1] + 1):
            folder = self.report and self.report / f"frame_{frame:04d}"
            documents.append(self._one(frame, folder))
        verdict = max((d["verdict"] for d in documents), key=list(CODES).index)
        whole = {"schema": documents[0]["schema"], "verdict": verdict, "frames": documents}
        if self.report:
            write_text(self.report / "report.json", dumps(whole))
        text = "\n".join(f"frame {d['scene']['frame']}: {d['verdict']}" for d in documents)
        return Outcome(whole, text, CODES[verdict])

    def _one(self, frame: int | None, folder: Path | None) -> dict[str, Any]:
        """Compare one frame, write its report, and return its document."""
        import numpy as np

        from ..checking import Check, Terms
        from ..linting import found_by
        from ..report.document import build_document

        started = time.perf_counter()
        bl_scene, scene = self.read(frame)
        pictures = self._pictures(scene)
        witness = None if pictures else self._witness(bl_scene, scene)
        if folder:
            try:
                folder.mkdir(parents=True, exist_ok=True)
            except OSError as error:
                said = f"expected a folder that can be made ({error.strerror})"
                raise RadError("cannot write there", str(folder), said) from None
        read = time.perf_counter() - started
        kept = witness.kept.get("cycles.film_exposure") if witness else None
        exposure = kept[0] if kept else self.exposure
        asked = self.tolerance, self.confidence, self.samples, self.threads, exposure
        terms = Terms(*asked, time_limit=self.time_limit and max(self.time_limit - read, 0.0))
        check = Check(scene, terms)
        if witness:
            own = witness.bl_scene.cycles.samples if self.witness_settings == "file" else None
            result = check.against(witness, self.samples or own)
        else:
            result = check.against_pictures(np.stack(pictures))
        document = build_document(
            scene,
            result,
            terms,
            efficacy_lm_W=self.efficacy,
            witness_name="pictures" if self.render else "Cycles",
            overridden=witness.overridden if witness else {},
            asked=self._asked(),
            seconds={"read": read},
        )
        if witness:
            document["findings"] += plain([*self._kept_settings(witness, result)])
        document["findings"] += plain(found_by("glass-blocks-light", scene, self.threads))
        if folder:
            self._write(folder, document, scene, result)
        return document

    def _asked(self) -> dict[str, list[str]]:
        """Return the options that were given and that nothing else in the document tells."""
        given = [e for e in fields(self) if e.name in ASKED.split() and self._has(e)]
        found = {flag_of(entry): getattr(self, entry.name) for entry in given}
        return {k: [str(v) for v in (x if type(x) is tuple else [x])] for k, x in found.items()}

    def _pictures(self, scene: Scene) -> list[Singles]:
        """Return the pictures to judge, each (h, w, 3)."""
        from ..exr import read_picture

        pictures = [read_picture(path, scene.chromaticities) for path in self.render]
        expected = "x".join(map(str, scene.resolution))
        for path, picture in zip(self.render, pictures, strict=True):
            height, width = picture.shape[:2]
            if (width, height) != scene.resolution:
                what = f"a picture of {width}x{height} pixels"
                raise RadError(what, str(path), f"expected {expected}, the resolution compared")
        return pictures

    def _witness(self, bl_scene: Any, scene: Scene) -> CyclesWitness:
        from ..bpy_io.witness import CyclesWitness

        if self.witness_scene is not None:
            bl_scene = self.open(self.witness_scene, scene.frame, need_camera=True)
        witness = CyclesWitness(
            bl_scene,
            resolution=scene.resolution if self.witness_scene else self.resolution,
            shading=self.shading,
            settings=self.witness_settings,
            threads=self.threads,
        )
        witness.prepare()
        return witness

    def _kept_settings(self, witness: CyclesWitness, result: Result) -> Iterator[Finding]:
        """Yield the file's own settings that are not the unbiased; what they do, where it differs.

        That is measured: the same seeds once more, each time with one of them less.
        """
        from ..compare.claims import TILE_TOLERANCES
        from ..compare.diagnosis import NEGLIGIBLE
        from ..compare.effects import effect_of

        named = set[str]()
        known = {finding.code for finding in result.comparison.findings}
        if result.comparison.verdict == "differ" and result.witness_samples:
            pictures = result.pictures[:TAKEN_BACK_SEEDS]
            for code, own, *both in witness.taken_back(pictures, result.witness_samples):
                effect, percent = effect_of(*both), 100.0 * NEGLIGIBLE * self.tolerance
                severe = effect.is_beyond(percent, TILE_TOLERANCES * percent)
                listed = ", ".join(f"{name.split('.')[1]} {value}" for name, value in own.items())
                message = f"{code.replace('-', ' ')} left on in the witness ({listed}): {effect}"
                severity = "error" if severe else "info"
                named |= set(own)
                if code not in known:
                    yield Finding(code, severity, "", message, effect.whole)
        for name, (own, unbiased) in witness.kept.items():
            if name not in named:
                said = f"{name} is {own!r}; the unbiased is {unbiased!r}"
                yield Finding("witness-setting", "info", name, said)

    def _write(self, folder: Path, document: dict[str, Any], scene: Scene, result: Result) -> None:
        """Write the five files; `report.json` last, so that where it is, all are."""
        from ..exr import PASSES, film_channels, film_header, write_exr
        from ..report import ReportData, render_report
        from ..report.difference import difference

        started = time.perf_counter()
        film, header = result.film, film_header(result.film, scene, self.efficacy)
        passes = (*PASSES, *(f"Light.{name}" for name in film.lights))
        write_exr(folder / "ours.exr", film_channels(film, scene, self.efficacy, passes), header)
        write_exr(folder / "cycles.exr", _rgb(result.witness), header)
        data = ReportData(
            document=document,
            ours=film.radiance,
            witness=result.witness,
            excluded=film.excluded,
            inside=film.inside,
            variance_ours=film.variance,
            variance_witness=result.witness_variance,
            luminance_weights=scene.luminance_weights,
            efficacy_lm_W=self.efficacy,
            chromaticities=scene.chromaticities,
            witness_name="the picture" if self.render else "Cycles",
        )
        relative, _ = difference(data, self.tolerance)
        pixels = _rgb(result.witness - film.radiance) | {"Relative.V": relative}
        write_exr(folder / "difference.exr", pixels, header)
        write_text(folder / "report.html", render_report(data))
        document["seconds"]["report"] = time.perf_counter() - started
        write_text(folder / "report.json", dumps(document))


def _rgb(image: Any) -> dict[str, Any]:
    return {letter: image[..., k] for k, letter in enumerate("RGB")}


def _table(document: dict[str, Any]) -> str:
    """Return the verdict and the lights as a short table."""
    rows = [["light", "type", "share", "in witness", "verdict"]]
    for light in document["lights"]:
        factor, error = light["scale_in_witness"], light["standard_error"]
        known = "-" if factor is None else f"{factor:.4f} ± {error:.4f}"
        share = f"{100 * light['energy_fraction']:4.1f} %"
        verdict = " ".join(filter(None, [light["verdict"], light["diagnosis"]]))
        rows.append([light["name"], light["type"], share, known, verdict])
    compared = f"{100 * document['coverage']['supported_pixel_fraction']:.1f} % of the picture"
    findings = (str(Finding(**finding)) for finding in document["findings"])
    lines = [document["verdict"], "", *aligned(rows, left=5), "", f"{compared} is compared"]
    return "\n".join([*lines, *findings])
