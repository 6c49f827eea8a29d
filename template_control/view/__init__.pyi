from .figures import FIGURES as FIGURES
from .figures import save_figures as save_figures
from .replay.replay import save_film as save_film
from .replay.replay import save_html as save_html
from .scenario_figures import save_scenario_figures as save_scenario_figures
from .stability_figures import basin_figure as basin_figure
from .stability_figures import branch_figure as branch_figure
from .stability_figures import deadbeat_figure as deadbeat_figure
