"""The sample door from Python, cell by cell, as in a notebook; shown in python.md."""

# %% Simulate the film of a recording
import matplotlib.pyplot as plt

import paint_deposition as paint

samples = paint.sample_folder()
door = paint.read_mesh(samples / 'door.stl', max_edge_length_m=0.02)
recording = paint.read_recording(samples / 'door_horizontal', state_topic='/atomizer/state')
film = paint.simulate(door, recording, target_um=18.0, tolerance_um=4.0)
print(film)

# %% Look at it, as a picture and in figures
figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5))
paint.plot(film, ax=left).set_title('Film on the door [µm]')
right.hist(film.film_um, bins=40, weights=film.surface.vertex_areas_m2)
right.set(xlabel='film [µm]', ylabel='area [m²]')
print(film.to_dict()['within_target'])

# %% Fit the pattern to a flat panel, and choose the index of the passes
panels = paint.read_campaign(samples / 'panel_study/campaign.yaml')
calibration = paint.calibrate(panels)
index = paint.recommend(calibration.model, target_um=20.0, tolerance=0.05, width_m=0.9)
print(calibration, index, sep='\n')
paint.plot(index, ax=plt.figure().gca())

# %% Lay passes over the door
plan = paint.plan(door, calibration.model, target_um=20.0)
print(plan)

# %% A more even film along the same path
better = paint.improve(door, plan.trajectory, calibration.model, speed_max_m_per_s=0.6)
print(better)
print(*(change.sentence for change in better.changes), sep='\n')

# %% Compare a model with gauge readings
campaign = paint.read_campaign(samples / 'measured_door/campaign.yaml')
comparison = paint.compare(campaign)
print(comparison)
print([region.description for region in comparison.regions])

# %% Find the effect that it lacks
diagnosis = paint.diagnose(campaign)
print(diagnosis)
print(diagnosis.reason)
paint.plot(diagnosis, ax=plt.figure().gca())

# %% Write what the command line writes
files = paint.write(diagnosis, 'results/diagnosis')
paint.write_model('results/model.yaml', diagnosis.model)
