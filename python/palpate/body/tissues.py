"""Measured stiffness of tissues and phantoms, each with its source.

Every source takes its material for incompressible: elastography finds the shear modulus `G` and reports `E = 3 G`, and
indentation is evaluated with a Poisson's ratio of 0.495. Finite elements need a ratio below one half, so 0.49 stands
here for what a source calls incompressible.
"""

from __future__ import annotations

from dataclasses import dataclass

INCOMPRESSIBLE = 0.49
NOT_CHECKED = "not checked at the source"


@dataclass(frozen=True)
class Tissue:
    """A material with a published measurement."""

    # What programs and people call it.
    name: str
    title: str
    youngs_modulus: float  # Pa
    spread: float  # standard deviation over the samples of the source, Pa; 0 where the source has none
    poissons_ratio: float  # as taken by the source, below one half
    source: str  # authors, year, journal, and how it was measured
    # Whether the figures were compared with the source itself. The abstract alone, or another's quotation, is not it.
    checked: bool = True

    @property
    def citation(self) -> str:
        """Source, and whether its figures were not checked there."""
        return self.source if self.checked else f"{self.source} ({NOT_CHECKED})"


TISSUES = (
    Tissue(
        *("liver", "Liver", 5.49e3, 1.59e3, INCOMPRESSIBLE),
        "Roulot et al. 2008, J. Hepatol. 48:606, transient elastography of 429 healthy people",
    ),
    Tissue(
        *("kidney", "Kidney, cortex", 5.0e3, 2.9e3, INCOMPRESSIBLE),
        "Arda et al. 2011, Am. J. Roentgenol. 197:532, shear-wave elastography of 127 healthy people",
    ),
    Tissue(
        *("spleen", "Spleen", 2.9e3, 1.8e3, INCOMPRESSIBLE),
        "Arda et al. 2011, Am. J. Roentgenol. 197:532, shear-wave elastography of 127 healthy people",
    ),
    Tissue(
        *("muscle", "Muscle, gastrocnemius", 11.1e3, 4.1e3, INCOMPRESSIBLE),
        "Arda et al. 2011, Am. J. Roentgenol. 197:532, shear-wave elastography of 127 healthy people",
    ),
    Tissue(
        *("fat", "Fat, breast", 3.25e3, 0.91e3, 0.495),
        "Samani et al. 2007, Phys. Med. Biol. 52:1565, indentation of fresh samples",
        # The abstract confirms that fat is as stiff as fibroglandular tissue, without figures.
        checked=False,
    ),
    Tissue(
        *("gelatine", "Gelatine, 5 %", 12.54e3, 2.52e3, INCOMPRESSIBLE),
        "Nguyen et al. 2014, Ultrasound Med. Biol. 40:168, shear waves: G = 4.18 kPa",
    ),
    Tissue(
        *("silicone", "Silicone, Ecoflex 00-30", 69e3, 0.0, INCOMPRESSIBLE),
        "Smooth-On, technical bulletin of the Ecoflex series: modulus at 100 % strain, 10 psi",
        # Others quote 10 psi from the bulletin. It is stress over strain at 100 %, not the slope at small strains.
        checked=False,
    ),
)
