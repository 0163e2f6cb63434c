"""Small arms whose geometry can be worked out by hand."""

from __future__ import annotations

from pathlib import Path

from common.cell import RobotConfig

__all__ = ["PLANAR_URDF", "planar_config"]

# Two links of 0.3 and 0.25 m in the plane z = 0.1, boxes 4 cm thick, on a small base.
PLANAR_URDF = """<?xml version="1.0"?>
<robot name="planar">
  <link name="world"/>
  <link name="base"><collision><origin xyz="0 0 0.03"/><geometry><box size="0.1 0.1 0.06"/></geometry></collision></link>
  <link name="upper"><collision><origin xyz="0.15 0 0"/><geometry><box size="0.3 0.04 0.04"/></geometry></collision></link>
  <link name="lower"><collision><origin xyz="0.125 0 0"/><geometry><box size="0.25 0.04 0.04"/></geometry></collision></link>
  <link name="tip"/>
  <joint name="stand" type="fixed"><parent link="world"/><child link="base"/></joint>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/><origin xyz="0 0 0.1"/><axis xyz="0 0 1"/>
    <limit lower="-3.14" upper="3.14" velocity="2" effort="10"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/><origin xyz="0.3 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-3.14" upper="3.14" velocity="2" effort="10"/></joint>
  <joint name="end" type="fixed"><parent link="lower"/><child link="tip"/><origin xyz="0.25 0 0"/></joint>
</robot>
"""


def planar_config(folder: Path) -> RobotConfig:
    """The planar arm, its URDF written into ``folder``."""
    path = folder / "planar.urdf"
    path.write_text(PLANAR_URDF, encoding="utf-8")
    return RobotConfig(
        name="planar", urdf=str(path), flange_frame="tip", home_rad=[0.0, 0.0], max_acceleration_rad_s2=[5.0, 5.0], immobile_links=["base"]
    )
