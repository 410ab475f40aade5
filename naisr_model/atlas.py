"""``Atlas``: a trained population of shapes, in real units and millimetres.

>>> from naisr_model.shipped import shipped_atlas
>>> atlas = Atlas.load(shipped_atlas())
>>> boy = atlas.shape({"age": 120, "weight": 34, "sex": +1}, resolution=64)
>>> bool(40 < boy.volume / 1000 < 55)  # cm³
True
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from threadpoolctl import threadpool_limits
from torch import Tensor

from naisr_model.capabilities import Capabilities
from naisr_model.checkpoint import Checkpoint, load
from naisr_model.covariates import (
    Covariate,
    Population,
    Values,
    complete,
    interval_in_words,
    normalised_vector,
    require_known,
)
from naisr_model.errors import InputError
from naisr_model.frames import Extent, Frame
from naisr_model.learning.fitting.belief import places_of
from naisr_model.learning.fitting.evidence import ShapeFit
from naisr_model.learning.fitting.placing import Placing, placing_of
from naisr_model.learning.fitting.posterior import (
    POINTS,
    TWO_SIDED_95,
    Posterior,
    moved,
    nearness,
    posterior_of,
    remaining,
    surface_deviations,
    surface_offsets,
    volume_deviation,
)
from naisr_model.learning.fitting.prior import Prior, prior_of
from naisr_model.learning.fitting.search import fit_shape
from naisr_model.learning.fitting.target import draw_sample, target_of
from naisr_model.models.base import ShapeModel, additive, deformable
from naisr_model.models.devices import usable_device
from naisr_model.progress import SILENT, Progress
from naisr_model.shapes.kinds import Shape
from naisr_model.surface.blending import blended
from naisr_model.surface.carrying import carried
from naisr_model.surface.displacements import Displacements, DisplacementTables, tabulate
from naisr_model.surface.fields import distances, effect_field, shape_field, template_field
from naisr_model.surface.isosurface import isosurface
from naisr_model.surface.lattice import Lattice
from naisr_model.surface.maps import outward, rates, travelled
from naisr_model.surface.material import origins, parts, places
from naisr_model.surface.sparse import CHUNK, COARSEST, Field, evaluate_band
from naisr_model.surface.tracking import CodeTracker, FadingTracker, Tracker, make_tracker
from naisr_model.surface.volume import enclosed

VOLUME_RESOLUTION = 128
FINEST = 1024
"""Of the resolutions: its lattice takes 4 GB."""

UNEXPRESSED = 4.0
"""Standard deviations from which on a scan is not met by chance. Of six synthetic airways at most 0.3 % of
the surface lay beyond, and 1.6 to 4.4 % when a ring was widened by 2 mm, which no code can follow."""

DIFFERENTIATED = 4096
"""Points at a time at which derivatives are taken."""

TOGETHER = 4
"""Shapes that points are carried to at once: their activations stay in the processor's cache."""

CHECK_SAMPLE = 2000
"""Seed of the points at which a fit's residual is measured; the fit itself draws others."""

PROBED = 1500
"""Points at which the uncertainty of a surface is computed: it is smooth where the fit is good, so that what
is blended of them for the others is within a tenth of its value."""

TAIL = 0.025
"""Probability of lying below, and above, an interval."""

WORTH_TELLING = 0.05
"""Least probability of an alternative that is told."""

MISSED_SHARE = 0.02
"""Of the atlas's unit of length, about half of its largest shape: with a residual beyond it a fit is not
valid. Of airways and bodies that lie in place it is at most 0.0023; airways that lie 18 mm off have 0.027 to
0.038, spheres and other anatomy 0.17 and more."""

UNTOLD_SHARE = 0.5
"""An interval wider than this share of the observed range says that the shape hardly tells the covariate."""


class Atlas:
    """A trained atlas, answering in real units.

    It is the one door to every question that viewer, commands and notebooks may ask, hence its length; the
    answers are found in the rooms below.

    Everywhere, ``covariates`` maps names to values in real units (``{"age": 120}`` in the unit of
    ``atlas.covariates``; a binary covariate is -1 or +1, or between them); what is left out is at
    the population centre; that of a binary one has to be given where shapes there are not known, as with
    A-SDF. ``latent`` is a code z ``[L]``; left out, it is 0, the population
    average. Surfaces are ``trimesh.Trimesh`` in millimetres with outward faces, so their
    ``volume / 1000`` is in cm³; where no surface exists they have no faces. An atlas in the plane gives a
    :class:`~naisr_model.shapes.curve.Curve` in their place, in the unit of its frame. ``resolution`` is the
    number of cells along a side of the box, a multiple of 8. ``progress`` is told the finished share, and
    ends a computation that nobody waits for any more with :class:`~naisr_model.errors.Cancelled`.

    Inference has no randomness: the same question has the same answer.

    Args:
        checkpoint: what was trained.
        device: where the fields are evaluated and tabulated: cpu, cuda or mps. A tracker, which moves some
            thousand vertices, and a fit, which evaluates some hundred points a step, work on the CPU
            wherever that is.

    Raises:
        InputError: when torch cannot compute on the device.
    """

    def __init__(self, checkpoint: Checkpoint, device: str | torch.device = "cpu") -> None:
        self.checkpoint = checkpoint
        self.device = usable_device(device)
        self._model = checkpoint.model().to(self.device).requires_grad_(False)

    @classmethod
    def load(cls, path: str | Path, device: str | torch.device = "cpu") -> Atlas:
        """Read an atlas from a ``.safetensors`` file.

        Args:
            path: the file.
            device: where the fields are evaluated.

        Raises:
            InputError: when the file is missing, damaged, foreign or too new, or torch cannot compute on
                the device.
        """
        return cls(load(path), device)

    @property
    def name(self) -> str:
        """Name of the population, for example ``airway``."""
        return self.checkpoint.name

    @property
    def model_title(self) -> str:
        """The shape model as people call it, for example ``NAISR``."""
        return self._model.title

    @property
    def capabilities(self) -> Capabilities:
        """What the shape model can do; asking for anything else is an :class:`InputError`."""
        return self._model.capabilities

    @cached_property
    def population(self) -> Population:
        """Whom the atlas was made from, with those covariates in real units that shapes depend on."""
        return self._model.relevant(self.checkpoint.population)

    @property
    def covariates(self) -> tuple[Covariate, ...]:
        """Those covariates, each with name, unit, kind and observed range; there may be none."""
        return self.population.covariates

    @property
    def frame(self) -> Frame:
        """Millimetres to the networks' box."""
        return self.checkpoint.frame

    @property
    def extent(self) -> Extent:
        """What its shapes enclose, a volume or an area, and the unit that it is told in."""
        return self.frame.extent

    def sdf(
        self,
        points_mm: ArrayLike,
        covariates: Values,
        latent: ArrayLike | None = None,
        *,
        extrapolate: bool = False,
    ) -> NDArray[np.float64]:
        """Signed distance of points to the full shape, Phi / |grad Phi|.

        That is the distance to first order: exact on the surface, an estimate away from it.

        Args:
            points_mm: ``[n, dim]``.
            covariates: real values by name.
            latent: code z ``[L]``.
            extrapolate: allow values outside the observed range.

        Returns:
            Millimetres, negative inside, ``[n]``.

        Raises:
            InputError: for an unknown covariate or one out of range (unless ``extrapolate``).
        """
        points = self.frame.to_model(points_mm).astype(np.float32).reshape(-1, self.frame.dim)
        vector, code = self._vector(covariates, extrapolate), self._latent(latent)
        chunks = [
            distances(self._model, points[start : start + CHUNK], vector, code)
            for start in range(0, len(points), CHUNK)
        ]
        return np.concatenate([np.zeros(0), *chunks]) * self.frame.scale_mm

    def shape(
        self,
        covariates: Values,
        latent: ArrayLike | None = None,
        resolution: int = 128,
        *,
        extrapolate: bool = False,
        tracker: Tracker | None = None,
        progress: Progress = SILENT,
    ) -> Shape:
        """The full shape, the zero level set of Phi(p, c, z).

        A ``tracker`` of this atlas and code makes it several times faster; the surface is the same.

        Raises:
            InputError: for an unknown covariate or one out of range (unless ``extrapolate``).
            Cancelled: when nobody waits for it any more.
        """
        field = shape_field(self._model, self._vector(covariates, extrapolate), self._latent(latent))
        guess = None if tracker is None else tracker.guess(covariates)
        return self._surface(field, resolution, progress, guess)

    def effect(
        self,
        name: str,
        value: float,
        latent: ArrayLike | None = None,
        resolution: int = 128,
        *,
        extrapolate: bool = False,
        tracker: Tracker | None = None,
        progress: Progress = SILENT,
    ) -> Shape:
        """The effect of one covariate, Phi_i(p, c_i, z): Phi with the others at their centre.

        The displacements of several covariates add at one query point; these surfaces do not. A
        ``tracker`` of this atlas and code makes it several times faster; the surface is the same.

        Raises:
            InputError: for an unknown covariate or one out of range (unless ``extrapolate``), and where
                the model is not disentangleable.
            Cancelled: when nobody waits for it any more.
        """
        if not self.capabilities.disentangleable:
            raise InputError(f"{self.model_title} does not tell covariates apart; ask for the whole shape")
        vector = self._vector({name: value}, extrapolate)
        index = self.population.names.index(name)
        field = effect_field(self._model, index, vector, self._latent(latent))
        guess = None if tracker is None else tracker.guess({name: value})
        return self._surface(field, resolution, progress, guess)

    def template(
        self,
        resolution: int = 128,
        *,
        progress: Progress = SILENT,
    ) -> Shape:
        """The template, the zero level set of T.

        Raises:
            InputError: where the model deforms none.
            Cancelled: when nobody waits for it any more.
        """
        return self._surface(template_field(deformable(self._model)), resolution, progress)

    def tabulate(
        self,
        template: Shape,
        latent: ArrayLike | None = None,
        *,
        progress: Progress = SILENT,
    ) -> DisplacementTables:
        """The displacements of one code on a lattice, what :meth:`tracker` needs; takes seconds.

        Args:
            template: a mesh that :meth:`template` gave.
            latent: code z ``[L]``.
            progress: told the finished share, checked between chunks of points.

        Raises:
            InputError: where the model gives the covariates no displacements of their own, or of curves.
            Cancelled: when nobody waits for it any more.
        """
        model = additive(self._model)
        if self.frame.dim != 3:
            raise InputError("previews are carried in space only; ask this atlas for the curve itself")
        ranges = [(float(low), float(high)) for low, high in (c.normalise(c.range) for c in self.covariates)]
        bounds = self.frame.to_model(template.bounds)
        code = self._latent(latent)
        return tabulate(model, ranges, code, bounds, progress=progress)

    def tracker(self, template: Shape, tables: DisplacementTables) -> CodeTracker:
        """What carries ``template`` to any covariates in milliseconds, vertex by vertex.

        It also makes :meth:`shape` and :meth:`effect` faster.

        Args:
            template: a mesh that :meth:`template` gave.
            tables: from :meth:`tabulate`.

        Raises:
            InputError: where the model gives the covariates no displacements of their own.
        """
        return make_tracker(additive(self._model), self.covariates, self.frame, template, tables)

    def fit(
        self,
        shape: Shape | ArrayLike,
        known: Values | None = None,
        *,
        extrapolate: bool = False,
        progress: Progress = SILENT,
    ) -> Fit:
        """The code and the unknown covariates that explain a patient's shape best, and how sure they are.

        Args:
            shape: a mesh, watertight or open, a curve, or points ``[n, dim]``; mm of the atlas frame.
            known: covariate values in real units; those left out are inferred.
            extrapolate: allow known values outside the observed range.
            progress: told the finished share, checked between steps.

        Raises:
            InputError: for an unknown covariate or one out of range (unless ``extrapolate``), or a shape
                that has too few points.
            Cancelled: when nobody waits for it any more.
        """
        started = time.perf_counter()
        known = dict(known or {})
        self.complete(known, extrapolate=extrapolate)
        vector = np.array(
            [float(c.normalise(known[c.name])) if c.name in known else np.nan for c in self.covariates]
        )
        binary = [i for i, covariate in enumerate(self.covariates) if covariate.kind == "binary"]
        target = target_of(shape, self.frame)
        model = self._cpu_model
        # Threads of NumPy's linear algebra spin when it is torch's turn: on two cores twice the time.
        with threadpool_limits(1, user_api="blas"):
            fits = fit_shape(model, target, self._prior, vector, binary, progress=progress)
            posterior = posterior_of(model, target, self._prior, fits[0])
        check = draw_sample(target, POINTS, CHECK_SAMPLE).points[:POINTS].numpy()
        found, code = model.tensor(fits[0].covariates), model.tensor(fits[0].latent)
        residuals = np.abs(distances(model, check, found, code))
        return Fit(
            Individual(self, fits[0].covariates, fits[0].latent, posterior),
            tuple(fits),
            tuple(covariate.name for covariate in self.covariates if covariate.name not in known),
            residual_mm=float(residuals.mean()) * self.frame.scale_mm,
            seconds=time.perf_counter() - started,
        )

    def origins_mm(
        self, points_mm: ArrayLike, covariates: Values, latent: ArrayLike | None = None
    ) -> NDArray[np.float64]:
        """The template's points ``[n, dim]`` that points ``[n, dim]`` on a shape belong to.

        Raises:
            InputError: for an unknown covariate or one out of range, and where the model deforms no template.
        """
        model, points = deformable(self._model), self._model.tensor(self.frame.to_model(points_mm))
        vector, code = self._vector(covariates, False), self._latent(latent)
        return self.frame.to_mm(origins(model, points, vector, code).numpy(force=True))

    def contributions(
        self,
        origins_mm: ArrayLike,
        covariates: Values,
        latent: ArrayLike | None = None,
        start_mm: ArrayLike | None = None,
    ) -> Contributions:
        """Where points of the template are in a shape, and what each covariate has to do with that.

        Args:
            origins_mm: on the template, ``[n, dim]``.
            covariates: real values by name.
            latent: code z ``[L]``.
            start_mm: where the points may be, ``[n, dim]``, for instance as a tracker has them.

        Raises:
            InputError: for an unknown covariate or one out of range, where a point has no place because the
                deformation folds, and where the model gives the covariates no displacements of their own.
        """
        model, vector, code = additive(self._model), self._vector(covariates, False), self._latent(latent)
        targets = model.tensor(self.frame.to_model(origins_mm))
        start = None if start_mm is None else model.tensor(self.frame.to_model(start_mm))
        found = parts(model, places(model, targets, vector, code, start), vector, code)
        return Contributions(
            origins_mm=self.frame.to_mm(targets.numpy(force=True)),
            points_mm=self.frame.to_mm(found.points.numpy(force=True)),
            normals=found.normals.numpy(force=True),
            effects_mm=found.effects.numpy(force=True) * self.frame.scale_mm,
            person_mm=found.person.numpy(force=True) * self.frame.scale_mm,
        )

    def moved_mm(
        self, points_mm: ArrayLike, covariates: Values, latent: ArrayLike | None = None
    ) -> NDArray[np.float32]:
        """How far a shape's points ``[n, dim]`` have come from the template along its normals, ``[n]``.

        Raises:
            InputError: for an unknown covariate or one out of range, and where the model deforms no template.
        """
        model, vector, code = deformable(self._model), self._vector(covariates, False), self._latent(latent)
        found = self._in_pieces(points_mm, lambda points: travelled(model, points, vector, code))
        return found * np.float32(self.frame.scale_mm)

    def rates_mm(
        self, points_mm: ArrayLike, name: str, covariates: Values, latent: ArrayLike | None = None
    ) -> NDArray[np.float32]:
        """How fast a shape's surface moves outwards with one covariate at points ``[n, dim]``, ``[n]``.

        Returns:
            Millimetres per unit of the covariate, by automatic differentiation.

        Raises:
            InputError: for an unknown covariate or one out of range.
        """
        vector, code = self._vector(covariates, False), self._latent(latent)
        require_known([name], self.covariates)
        index = self.population.names.index(name)
        found = self._in_pieces(points_mm, lambda points: rates(self._model, points, vector, code, index))
        return found * np.float32(self.frame.scale_mm / self.covariates[index].scale)

    def contrast_mm(
        self, points_mm: ArrayLike, name: str, covariates: Values, latent: ArrayLike | None = None
    ) -> NDArray[np.float32]:
        """How much farther out a shape's points ``[n, dim]`` are at the second level of a covariate, ``[n]``.

        Their material points are found at both levels (or both ends of its range), everything else equal, and
        compared along the normals of the shape.

        Raises:
            InputError: for an unknown covariate or one out of range, where the deformation folds, and where
                the model deforms no template.
        """
        require_known([name], self.covariates)
        ends = self.covariates[self.population.names.index(name)].range
        origins_mm = self.origins_mm(points_mm, covariates, latent)
        codes = None if latent is None else [latent, latent]
        low, high = self.carried_mm(origins_mm, [{**covariates, name: end} for end in ends], codes)
        model, vector, code = self._model, self._vector(covariates, False), self._latent(latent)
        normals = self._in_pieces(points_mm, lambda points: outward(model, points, vector, code))
        return np.sum((high - low) * normals, axis=1).astype(np.float32)

    def _in_pieces(self, points_mm: ArrayLike, values_at: Callable[[Tensor], Tensor]) -> NDArray[np.float32]:
        """Values at points ``[n, dim]``, some at a time: derivatives hold all that led to them."""
        points = self._model.tensor(self.frame.to_model(points_mm))
        found = [values_at(piece).numpy(force=True) for piece in points.split(DIFFERENTIATED)]
        return np.concatenate(found)

    def carried_mm(
        self,
        origins_mm: ArrayLike,
        covariates: Sequence[Values],
        latents: Sequence[ArrayLike] | NDArray[np.floating] | None = None,
        *,
        progress: Progress = SILENT,
    ) -> NDArray[np.float64]:
        """Where points of the template are in many shapes, ``[shapes, n, dim]`` in millimetres.

        Args:
            origins_mm: on the template, ``[n, dim]``.
            covariates: real values by name, of each shape.
            latents: its code, ``[shapes, L]``; left out, the population average is meant.
            progress: told the finished share, checked between some shapes.

        Raises:
            InputError: for an unknown covariate or one out of range, where points have no place because the
                deformation folds, and where the model deforms no template.
            Cancelled: when nobody waits for it any more.
        """
        model, targets = deformable(self._model), self._model.tensor(self.frame.to_model(origins_mm))
        vectors = [self._vector(values, False) for values in covariates]
        average = [self._latent(None)] * len(vectors)
        codes = average if latents is None else [self._latent(code) for code in latents]
        pieces = progress.over(range(0, len(vectors), TOGETHER))
        found = [
            carried(
                model, targets, *(torch.stack(rows[start : start + TOGETHER]) for rows in (vectors, codes))
            )
            for start, _ in pieces
        ]
        return self.frame.to_mm(torch.cat(found).numpy(force=True))

    def complete(self, covariates: Values, *, extrapolate: bool = False) -> dict[str, float]:
        """Real values of all covariates; those left out are at the population centre.

        Raises:
            InputError: for an unknown covariate or one out of range (unless ``extrapolate``), and for any
                where shapes depend on none.
        """
        if covariates and not self.capabilities.evolvable:
            raise InputError(
                f"shapes of {self.model_title} depend on no covariates; leave out {', '.join(covariates)}"
            )
        return complete(self.covariates, covariates, extrapolate=extrapolate)

    @cached_property
    def _cpu_model(self) -> ShapeModel:
        if self.device.type == "cpu":
            return self._model
        return self.checkpoint.model().requires_grad_(False)

    @cached_property
    def _prior(self) -> Prior:
        return prior_of(self.population, self.checkpoint.latents)

    def _vector(self, covariates: Values, extrapolate: bool) -> Tensor:
        values = self.complete(covariates, extrapolate=extrapolate)
        binary = [one for one in self.covariates if one.kind == "binary" and one.name not in covariates]
        if binary and not self.capabilities.vanishes_at_centre:
            name, levels = binary[0].name, " or ".join(binary[0].levels)
            raise InputError(
                f"{self.model_title} knows no shape between the levels of '{name}'; give {levels}"
            )
        return self._model.tensor(normalised_vector(self.covariates, values))

    def _latent(self, latent: ArrayLike | None) -> Tensor:
        length = self.checkpoint.preset.network.latent
        code = self._model.tensor(np.zeros(length) if latent is None else latent)
        if code.shape != (length,):
            raise InputError(f"the latent code has shape {tuple(code.shape)}; this atlas needs ({length},)")
        return code

    def _surface(
        self,
        field: Field,
        resolution: int,
        progress: Progress,
        guess: Field | None = None,
    ) -> Shape:
        if not 2 * COARSEST <= resolution <= FINEST or resolution % COARSEST:
            raise InputError(
                f"resolution is {resolution}; give a multiple of {COARSEST} from {2 * COARSEST} to {FINEST}"
            )
        lattice = Lattice(resolution, self.frame.dim)
        surface = isosurface(evaluate_band(field, lattice, progress, guess), lattice, self.frame)
        if not np.isfinite(surface.vertices).all():
            raise InputError("there are no distances at these values; choose others nearer to the data")
        return surface


@dataclass(frozen=True, eq=False)
class Contributions:
    """How points of the template came to where they are in a shape; the effects and the person's part add up.

    Attributes:
        origins_mm: the points on the template, ``[n, dim]``.
        points_mm: the same material points in the shape, ``[n, dim]``.
        normals: outward unit normals of the shape there, ``[n, dim]``.
        effects_mm: how far each covariate moves them in everybody, ``[N, n, dim]``.
        person_mm: how far the code moves them besides, ``[n, dim]``; 0 for the population average.
    """

    origins_mm: NDArray[np.float64]
    points_mm: NDArray[np.float64]
    normals: NDArray[np.float32]
    effects_mm: NDArray[np.float64]
    person_mm: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Individual:
    """One person's shape at some covariates, with its uncertainty.

    Attributes:
        atlas: whose shape this is.
        vector: centred covariates, ``[N]``.
        latent: code z, ``[L]``.
        posterior: how sure covariates and code are.
    """

    atlas: Atlas
    vector: NDArray[np.float64]
    latent: NDArray[np.float64]
    posterior: Posterior

    @property
    def covariates(self) -> dict[str, float]:
        """Real values by name."""
        return {
            covariate.name: float(covariate.restore(value))
            for covariate, value in zip(self.atlas.covariates, self.vector, strict=True)
        }

    def shape(
        self,
        resolution: int = VOLUME_RESOLUTION,
        *,
        progress: Progress = SILENT,
    ) -> Shape:
        """The full shape in millimetres.

        Raises:
            Cancelled: when nobody waits for it any more.
        """
        return self.atlas.shape(
            self.covariates,
            self.latent,
            resolution,
            extrapolate=True,
            progress=progress,
        )

    def elsewhere(self, vector: NDArray[np.float64]) -> Individual:
        """A fitted person at other centred covariates ``[N]``, with what is expected to last of the code.

        How much that is says :func:`~naisr_model.learning.fitting.posterior.remaining`. It counts from the
        fit, so a person who has been moved is not to be moved again.
        """
        share = remaining(self.posterior, vector)
        return Individual(self.atlas, vector, share * self.latent, moved(self.posterior, vector))

    def tracker(
        self,
        template: Shape,
        *,
        progress: Progress = SILENT,
    ) -> FadingTracker:
        """What carries a template to this person :meth:`elsewhere` in milliseconds; takes seconds.

        Args:
            template: a mesh that :meth:`Atlas.template` gave.
            progress: told the finished share, checked between chunks of points.

        Raises:
            InputError: where the model gives the covariates no displacements of their own.
            Cancelled: when nobody waits for it any more.
        """
        atlas, lasting = self.atlas, self.posterior.problem.prior.lasting
        codes = (lasting * self.latent, self.latent)
        far, near = (atlas.tabulate(template, code, progress=piece) for code, piece in progress.over(codes))
        tracker = atlas.tracker(template, far)

        def nearness_of(values: Values) -> float:
            known = atlas.complete(values, extrapolate=True)
            return nearness(self.posterior, normalised_vector(atlas.covariates, known))

        return FadingTracker(
            tracker, dataclasses.replace(tracker, displacements=Displacements(near)), nearness_of
        )

    @cached_property
    def extent(self) -> float:
        """What the smooth shape encloses; the triangles of :attr:`surface` alone hold a little less."""
        return enclosed(self.surface) / self.atlas.extent.per_unit

    @cached_property
    def extent_interval(self) -> tuple[float, float]:
        """Where the true one is with a probability of 95 %."""
        margin = self.extent_margin(self.surface)
        return max(0.0, self.extent - margin), self.extent + margin

    def extent_margin(self, mesh: Shape) -> float:
        """Half of the 95 % interval of what a shape that :meth:`shape` gave encloses."""
        frame = self.atlas.frame
        if not len(mesh.faces):
            return 0.0
        points = frame.to_model(mesh.sample(POINTS, seed=0)).astype(np.float32)
        area = mesh.area / frame.scale_mm ** (frame.dim - 1)
        deviation = volume_deviation(self.posterior, points, area, self.vector, self.latent)
        return TWO_SIDED_95 * deviation * frame.scale_mm**frame.dim / frame.extent.per_unit

    @property
    def volume_cm3(self) -> float:
        """:attr:`extent` of a shape in space."""
        return self._in_space.extent

    @property
    def volume_interval_cm3(self) -> tuple[float, float]:
        """:attr:`extent_interval` of a shape in space."""
        return self._in_space.extent_interval

    def volume_margin_cm3(self, mesh: Shape) -> float:
        """:meth:`extent_margin` of a shape in space."""
        return self._in_space.extent_margin(mesh)

    @property
    def _in_space(self) -> Individual:
        if self.atlas.frame.dim != 3:
            raise InputError("a curve in the plane has no volume; ask for its area, the extent")
        return self

    def surface_offsets_mm(self, points_mm: ArrayLike) -> NDArray[np.float64]:
        """How the surface may lie along its normal at points ``[n, dim]`` on it, ``[P, n]``.

        See :func:`~naisr_model.learning.fitting.posterior.surface_offsets`.
        """
        points = self.atlas.frame.to_model(points_mm).astype(np.float32)
        offsets = surface_offsets(self.posterior, points, self.vector, self.latent)
        return offsets * self.atlas.frame.scale_mm

    @property
    def noise_mm(self) -> float:
        """Standard deviation of what the atlas cannot express of the surface."""
        return self.posterior.noise * self.atlas.frame.scale_mm

    def surface_sd_mm(self, points_mm: ArrayLike) -> NDArray[np.float64]:
        """Standard deviation of the surface along its normal at points ``[n, dim]`` on it, ``[n]``."""
        points = self.atlas.frame.to_model(points_mm).astype(np.float32)
        deviations = surface_deviations(self.posterior, points, self.vector, self.latent)
        return deviations * self.atlas.frame.scale_mm

    def surface_margin_mm(self, points_mm: ArrayLike) -> NDArray[np.float64]:
        """Half of the 95 % interval of the surface's place along its normal at many points on it, ``[n]``.

        It is :meth:`surface_sd_mm` at about :data:`PROBED` of them, and between these blended.

        Args:
            points_mm: ``[n, dim]``, spread over the surface.
        """
        points = np.asarray(points_mm)
        probed = points[:: max(1, len(points) // PROBED)]
        return TWO_SIDED_95 * blended(probed, self.surface_sd_mm(probed), points)

    def unexpressed(self, points_mm: ArrayLike) -> NDArray[np.bool_]:
        """Which points ``[n, dim]`` of the patient's surface the atlas cannot express, ``[n]``.

        They lie farther from the fitted surface than :data:`UNEXPRESSED` standard deviations of its place
        and of the noise of the fit together.
        """
        points = np.asarray(points_mm)
        sd_mm = self.surface_margin_mm(points) / TWO_SIDED_95
        away_mm = self.atlas.sdf(points, self.covariates, self.latent)
        return np.asarray(np.abs(away_mm) > UNEXPRESSED * np.hypot(sd_mm, self.noise_mm))

    @cached_property
    def surface(self) -> Shape:
        """The shape at :data:`VOLUME_RESOLUTION`, which volumes are measured on."""
        return self.shape(VOLUME_RESOLUTION)


@dataclass(frozen=True)
class Alternative:
    """Covariates that explain a shape too, in real units, and how probable they are against the others."""

    covariates: dict[str, float]
    probability: float


@dataclass(frozen=True, eq=False)
class Fit:
    """What :meth:`Atlas.fit` found.

    Attributes:
        individual: the fitted shape with its uncertainty.
        results: the fits of explanations that differ in their covariates, the best first.
        inferred: names of the covariates that were not known.
        residual_mm: mean distance of the patient's points, others than those of the fit, to the surface.
        seconds: what the fit took.
        astray_mm: how far off the patient seems to lie, where somebody has looked and found that it does.
    """

    individual: Individual
    results: tuple[ShapeFit, ...]
    inferred: tuple[str, ...]
    residual_mm: float
    seconds: float
    astray_mm: float | None = None

    @property
    def covariates(self) -> dict[str, float]:
        """Real values by name, known and inferred ones."""
        return self.individual.covariates

    @property
    def latent(self) -> NDArray[np.float64]:
        """The code z, ``[L]``."""
        return self.individual.latent

    @property
    def alternatives(self) -> tuple[Alternative, ...]:
        """Everything that explains the shape with a probability worth telling, the best first.

        One alternative means that nothing far from the covariates told explains the shape.
        """
        told = [
            Alternative(self._real(result.covariates), float(share))
            for result, share in zip(self.results, self._shares, strict=True)
        ]
        return tuple(one for one in told if one.probability >= WORTH_TELLING)

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Where each inferred covariate is with a probability of 95 %, real units.

        Continuous covariates keep to their observed range; a binary one spans both of its levels
        where both are possible.
        """
        columns = enumerate(self.individual.atlas.covariates)
        return {one.name: self._interval(column, one) for column, one in columns if one.name in self.inferred}

    @property
    def covariances(self) -> dict[tuple[str, str], float]:
        """Of the inferred continuous covariates, about the values told, in the product of their units.

        All explanations together: ``sum_k p_k (S_k + (m_k - m)(m_k - m)^T)`` with the probability p_k of
        each, its covariance S_k and its values m_k.
        """
        told, free = self.results[0].covariates, self.results[0].free
        offsets = np.array([result.covariates - told for result in self.results])[:, free]
        within = np.einsum("k,kij->ij", self._shares, np.array([result.spread for result in self.results]))
        across = within + (offsets.T * self._shares) @ offsets
        chosen = [self.individual.atlas.covariates[column] for column in free]
        return {
            (one.name, other.name): float(across[i, j] * one.scale * other.scale)
            for i, one in enumerate(chosen)
            for j, other in enumerate(chosen)
        }

    @property
    def lasting(self) -> float:
        """Share of the code that is kept far from the fitted covariates: what two visits have in common."""
        return self.individual.posterior.problem.prior.lasting

    @property
    def is_valid(self) -> bool:
        """Whether the shape was met at all: nothing else that is told means anything otherwise.

        This is where it is decided that something is not such a shape as the atlas knows, or does not lie
        as they do.
        """
        return self.residual_mm <= MISSED_SHARE * self.individual.atlas.frame.scale_mm

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on a patient astray and covariates that it does not settle, or one on a shape missed."""
        length = self.individual.atlas.frame.length
        if not self.is_valid:
            return (
                f"not valid: the fitted surface is {length(self.residual_mm)} from the scan on average; "
                "align it to the atlas, and check that it is such a shape",
            )
        sentences = []
        if self.astray_mm is not None:
            sentences.append(f"the scan seems to lie {length(self.astray_mm)} off; align it to the atlas")
        for covariate in self.individual.atlas.covariates:
            low, high = self.intervals.get(covariate.name, (0.0, 0.0))
            extent = covariate.range[1] - covariate.range[0]
            if covariate.kind == "binary" and high > low:
                sentences.append(f"the scan does not tell {covariate.name}: both levels explain it")
            elif high - low > UNTOLD_SHARE * extent:
                sentences.append(
                    f"the scan hardly tells {covariate.name}: "
                    f"anything from {interval_in_words(covariate, low, high)} explains it"
                )
        return tuple(sentences)

    def placing_mm(self, shape: Shape | ArrayLike, *, progress: Progress = SILENT) -> Placing:
        """The rigid motion in millimetres after which this or a better fit explains the patient best.

        It is sought together with the code and the inferred covariates, see
        :mod:`~naisr_model.learning.fitting.placing`.

        Args:
            shape: of the patient as it was fitted.
            progress: checked between steps.

        Raises:
            Cancelled: when nobody waits for it any more.
        """
        individual, frame = self.individual, self.individual.atlas.frame
        problem = individual.posterior.problem
        sample = draw_sample(target_of(shape, frame), POINTS, CHECK_SAMPLE)
        with threadpool_limits(1, user_api="blas"):
            found = placing_of(problem, sample, problem.pack(individual.vector, individual.latent), progress)
        motion = found.motion.copy()
        motion[:-1, -1] = frame.to_mm(motion[:-1, -1]) - motion[:-1, :-1] @ np.array(frame.centre_mm)
        far, before, after = (frame.scale_mm * each for each in (found.moved, found.before, found.after))
        return Placing(motion, far, before, after)

    @property
    def extent(self) -> float:
        """What the fitted shape encloses, in the unit of :attr:`Atlas.extent`."""
        return self.individual.extent

    @property
    def extent_interval(self) -> tuple[float, float]:
        """Where the true one is with a probability of 95 %."""
        return self.individual.extent_interval

    @property
    def volume_cm3(self) -> float:
        """:attr:`extent` of a shape in space."""
        return self.individual.volume_cm3

    @property
    def volume_interval_cm3(self) -> tuple[float, float]:
        """:attr:`extent_interval` of a shape in space."""
        return self.individual.volume_interval_cm3

    def shape(self, resolution: int = VOLUME_RESOLUTION) -> Shape:
        """The fitted shape in millimetres."""
        return self.individual.shape(resolution)

    def surface_sd_mm(self, points_mm: ArrayLike) -> NDArray[np.float64]:
        """Standard deviation of the surface along its normal at points ``[n, dim]`` on it, ``[n]``."""
        return self.individual.surface_sd_mm(points_mm)

    def at(self, values: Values, *, extrapolate: bool = False) -> Individual:
        """The same person at other covariates, another day; covariates left out stay as fitted.

        The paper's shape transfer keeps the whole code. Here only what is expected to last from one
        visit to another is kept of it, see :meth:`Individual.elsewhere`.

        Raises:
            InputError: for an unknown covariate or one out of range (unless ``extrapolate``), and for others
                than those of the fit where the model is not transferable.
        """
        atlas = self.individual.atlas
        known = atlas.complete({**self.covariates, **values}, extrapolate=extrapolate)
        vector = normalised_vector(atlas.covariates, known)
        if nearness(self.individual.posterior, vector) < 1 and not atlas.capabilities.transferable:
            raise InputError(
                f"{atlas.model_title} does not carry shapes to other covariates; ask for the fitted shape"
            )
        return self.individual.elsewhere(vector)

    def _real(self, vector: NDArray[np.float64]) -> dict[str, float]:
        pairs = zip(self.individual.atlas.covariates, vector, strict=True)
        return {covariate.name: float(covariate.restore(value)) for covariate, value in pairs}

    @property
    def _shares(self) -> NDArray[np.float64]:
        """Probability of each of the results."""
        surprises = np.array([result.surprise for result in self.results])
        odds = np.exp((surprises.min() - surprises) / 2)
        return np.asarray(odds / odds.sum())

    def _interval(self, column: int, covariate: Covariate) -> tuple[float, float]:
        """The middle 95 % of all explanations; of a binary covariate the levels worth telling."""
        if covariate.kind == "binary":
            levels = np.array([result.covariates[column] for result in self.results])
            possible = [level for level in levels if self._shares[levels == level].sum() >= WORTH_TELLING]
            return float(min(possible)), float(max(possible))
        number = int(np.flatnonzero(self.results[0].free == column)[0])
        densities = np.array([result.densities[number] for result in self.results])
        places = places_of(self.individual.posterior.problem.prior, column)
        ends = np.interp([TAIL, 1 - TAIL], np.cumsum(self._shares @ densities), places)
        low, high = covariate.restore(ends).tolist()
        return low, high
