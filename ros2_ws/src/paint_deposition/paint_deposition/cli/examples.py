"""An example of each command, for its help: as it runs in the folder of the samples."""

EXAMPLES = {
    'simulate': '--mesh door.stl --trajectory door_horizontal --trigger /atomizer/state -o film',
    'calibrate': 'panel_study/campaign.yaml -o bell',
    'recommend': '--model bell/model.yaml --target-um 20 -o index',
    'plan': '--mesh door.stl --model bell/model.yaml --target-um 20 -o passes',
    'improve': '--mesh door.stl --trajectory passes/trajectory --model found/model.yaml -o better',
    'measure': '--mesh door.stl --trajectory door_horizontal --points 40 -o points',
    'compare': 'measured_door/campaign.yaml --model bell/model.yaml -o compared',
    'diagnose': 'measured_door/campaign.yaml --model bell/model.yaml -o found',
    'refit': 'measured_door/campaign.yaml --add incidence_attraction -o refitted',
    'sweep': 'my_sweep.yaml -o swept',
    'locate': '--touched my_touched.csv --points my_points.csv',
    'inspect': 'door_horizontal --mesh door.stl --out door.png',
    'recover': 'my_broken_run -o recovered',
    'place': '--trajectory passes/passes.mod --urdf my_arm.urdf --part-pose 2 0 0 0 0 0 1 -o map',
    'watch': 'door_horizontal --mesh door.stl --trigger /atomizer/state',
    'view': 'door_horizontal',
    'demo': '-o my_demo',
    'doctor': '--json',
}
