"""The paper's Figures 4 to 12 from measured records, and what the paper lacks."""

from . import charts, surfaces

PLOTS = (
    surfaces.heat_times,
    surfaces.images,
    charts.histograms,
    charts.table_1,
    charts.seconds,
    charts.seconds_growth,
    surfaces.heat_and_centroid,
    charts.centers,
    charts.mobius,
    charts.mobius_seconds,
    charts.factorizations,
    charts.phases,
    charts.angles_against_areas,
    charts.performance_profiles,
)
