"""What a strain energy declares. One file per material; the registry finds it."""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from dataclasses import astuple, dataclass, fields
from types import FunctionType
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from bayesmembrane.ground.errors import SettingsError
from bayesmembrane.ground.parameters import Array, Natural, Normal, Parameter

Derivatives = tuple[Any, Any, Any, Any, Any, Any]

LN_GD = Parameter("ln_gd", "ln(N/m)", "log of shear modulus x thickness", Normal(np.log(15.0), 2.0), (-7.0, 14.0))
"""The first coordinate of every material: materials share one prior on the modulus, and searches scale films by it."""


@dataclass(frozen=True)
class Material(ABC):
    """Isotropic, incompressible membrane with energy W(l1, l2) per reference area, in N/m.

    W(l1, l2) = d W3D(l1, l2, 1/(l1 l2)), with film thickness d; l1, l2 are the principal stretches.
    The class is the claim ("this film is a Yeoh film"); an instance, whose fields are the membrane parameters
    (N/m; exponents and Gent's limit dimensionless), is one calibrated film.

    A subclass is a frozen dataclass with float fields and these members:

    name, title, reference : how users call it, how reports print it, where it comes from
    colour : of its curves in reports, "#rrggbb"; "" leaves the choice to the report
    ordinary : False keeps it out of "all energies": it is fitted and compared only where its name is given
    units, meanings : unit of each field, and what it is in a few words
    scales : per field, 1 if it scales with the modulus (N/m), 0 if it does not: F(s c) = s F(c)
    coordinates : the `Parameter` s in which it is sampled, with their priors; the first one is `LN_GD`
    ``derivatives``, ``sensitivities`` : closed forms, see there; models of invariants find theirs in `invariants`
    ``to_coordinates``, ``from_coordinates`` : the bijection between fields and coordinates
    ``shear_modulus`` : G d in N/m
    """

    name: ClassVar[str]
    title: ClassVar[str]
    colour: ClassVar[str] = ""
    ordinary: ClassVar[bool] = True
    reference: ClassVar[str]
    units: ClassVar[tuple[str, ...]]
    meanings: ClassVar[tuple[str, ...]]
    scales: ClassVar[tuple[int, ...]]
    coordinates: ClassVar[tuple[Parameter, ...]]

    @staticmethod
    @abstractmethod
    def derivatives(p: Any, l1: Any, l2: Any) -> Derivatives:
        """(W, W1, W2, W11, W12, W22) at stretches l1, l2, in N/m; ``p[i]`` is field i.

        Plain arithmetic and ``math``-like NumPy ufuncs only: the same text runs on arrays (anything that broadcasts
        with ``p[i]``) and, compiled by numba, on scalars. Outside the domain (Gent beyond its limit) it returns nan.
        """

    @staticmethod
    @abstractmethod
    def sensitivities(p: Any, l1: Any, l2: Any) -> tuple[tuple[Any, Any, Any], ...]:
        """(dW/dp_i, dW1/dp_i, dW2/dp_i) for each field i; same rules as ``derivatives``."""

    @staticmethod
    @abstractmethod
    def to_coordinates(p: ArrayLike) -> Array:
        """Fields (n_fields, ...) -> sampling coordinates (n_coordinates, ...); nan where there are none."""

    @staticmethod
    @abstractmethod
    def from_coordinates(x: ArrayLike) -> Array:
        """Sampling coordinates (n_coordinates, ...) -> fields (n_fields, ...)."""

    @staticmethod
    @abstractmethod
    def shear_modulus(p: Any) -> Any:
        """G d in N/m: the initial slope is W11(1, 1) = 2 W12(1, 1) = 4 G d."""

    @staticmethod
    def neo_hookean(gd: float) -> Array | None:
        """Coordinates (n_coordinates,) within bounds of the film that is neo-Hookean with modulus ``gd`` = G d (N/m).

        Where the energy becomes neo-Hookean only in a limit, those next to it; None if it never does. A fit tries them
        too, so that an energy never fits worse than the one that it contains.
        """
        return None

    @staticmethod
    def convex_everywhere(p: Any) -> Any:
        """True where W is known to be strictly convex in every state that exists, from the parameters alone; False
        where only the states themselves can tell.
        """
        return np.zeros(np.shape(p[0]), dtype=bool)

    @staticmethod
    def extensibility(p: Any) -> Any:
        """The bound on I1 - 3 that no state can pass; infinity unless the chains lock."""
        return np.full(np.shape(p[0]), np.inf)

    # ---- what follows from the above -------------------------------------------------------------------------------

    @classmethod
    def field_names(cls) -> tuple[str, ...]:
        """Names of the membrane parameters, in the order of ``p``."""
        return tuple(f.name for f in fields(cls))

    @classmethod
    def natural_parameters(cls) -> tuple[Natural, ...]:
        """The membrane parameters as users read them."""
        return tuple(Natural(*each) for each in zip(cls.field_names(), cls.units, cls.meanings, strict=True))

    @classmethod
    def typical(cls) -> Array:
        """(n_fields,) membrane parameters at the 60 % quantiles of the priors: none is zero, as medians may be."""
        x = [float(c.prior.quantile(0.6)) for c in cls.coordinates]
        return cls.from_coordinates(np.array(x))

    @classmethod
    def from_vector(cls, p: ArrayLike) -> Self:
        """The film with parameter vector ``p`` of shape (n_fields,); raises `SettingsError` if there is none."""
        values = np.asarray(p, dtype=float).ravel()
        names = cls.field_names()
        if values.size != len(names):
            raise SettingsError(
                f"{cls.name} has {len(names)} parameters ({', '.join(names)}), and {values.size} were given",
                remedy="give one value for each, separated by commas",
            )
        if not np.all(np.isfinite(values)):
            raise SettingsError(f"the parameters of {cls.name} must be finite numbers, and {values.tolist()} are not")
        if not cls.extensibility(values) > 0:
            raise SettingsError(
                f"{cls.name} with the parameters {values.tolist()} has no film: its I1 - 3 would have to stay below "
                f"{float(cls.extensibility(values)):g}",
                remedy="give a positive limit",
            )
        return cls(*(float(v) for v in values))

    @classmethod
    def from_3d(cls, constants: ArrayLike, thickness: float) -> Self:
        """Membrane film of thickness d (m) from 3-D constants of the same form (Pa; exponents unchanged).

        C_i = d C_i0: every modulus-like field is multiplied by d. Gent's first constant is mu / 2, and Ogden's are
        the mu_i of sum mu_i / a_i (...), see the material's own reference for what its constants are.
        """
        p = np.asarray(constants, dtype=float) * np.where(np.asarray(cls.scales) == 1, thickness, 1.0)
        return cls.from_vector(p)

    def to_3d(self, thickness: float) -> Array:
        """3-D constants (Pa; exponents unchanged) of a film of thickness d (m), the inverse of ``from_3d``."""
        return self.vector / np.where(np.asarray(self.scales) == 1, thickness, 1.0)

    @property
    def vector(self) -> Array:
        """The fields as an array of shape (n_fields,)."""
        return np.array(astuple(self), dtype=float)

    def energy(self, l1: ArrayLike, l2: ArrayLike) -> Array:
        """W(l1, l2) in N/m, broadcast over the stretches."""
        return self._at(l1, l2)[0]

    def tension(self, l1: ArrayLike, l2: ArrayLike) -> tuple[Array, Array]:
        """Nominal tensions (P1, P2) = (dW/dl1, dW/dl2) in N per metre of reference length."""
        values = self._at(l1, l2)
        return values[1], values[2]

    def hessian(self, l1: ArrayLike, l2: ArrayLike) -> Array:
        """Second derivatives of W in the stretches, shape (..., 2, 2), N/m."""
        _, _, _, w11, w12, w22 = self._at(l1, l2)
        return np.stack([np.stack([w11, w12], -1), np.stack([w12, w22], -1)], -2)

    def _at(self, l1: ArrayLike, l2: ArrayLike) -> tuple[Array, ...]:
        a, b = np.broadcast_arrays(np.asarray(l1, dtype=float), np.asarray(l2, dtype=float))
        with np.errstate(all="ignore"):
            return tuple(np.asarray(v, dtype=float) + 0.0 * a for v in self.derivatives(self.vector, a, b))

    @classmethod
    def source_text(cls) -> str:
        """The texts of the class and of all that its closed forms call: compiled kernels are cached under its hash."""
        found: dict[str, str] = {}
        for function in (cls.derivatives, cls.sensitivities):
            _collect(function, found)
        return "".join([inspect.getsource(cls), *(found[k] for k in sorted(found))])


def _collect(function: Any, found: dict[str, str]) -> None:
    """Add the text of a function, of the functions that it names, and the numbers that it names to ``found``."""
    if (key := f"{function.__module__}.{function.__qualname__}") in found:
        return
    found[key] = inspect.getsource(function)
    for name in function.__code__.co_names:
        value = function.__globals__.get(name)
        if isinstance(value, FunctionType):
            _collect(value, found)
        elif isinstance(value, int | float | tuple):
            found[f"{function.__module__}.{name}"] = f"{name} = {value!r}\n"
