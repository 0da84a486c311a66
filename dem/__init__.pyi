from dem.batch.campaign import campaign as campaign
from dem.batch.sweep import sweep as sweep
from dem.calibration.calibrate import calibrate as calibrate
from dem.run.run import resume as resume, run_scene as run_scene
