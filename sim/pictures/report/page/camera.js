"use strict";
// The camera of the 3-D view: parallel projection, turned about a point.
(() => {
  const RIGHT_ANGLE = Math.PI / 2;
  const VIEWS = {
    iso: [-0.62, 0.62],
    top: [0, RIGHT_ANGLE],
    front: [0, 0],
    right: [RIGHT_ANGLE, 0],
  };

  /** @returns {{target: number[], yaw: number, pitch: number, zoom: number}} zoom: px per mm */
  const make = () => ({ target: [0, 0, 0], yaw: VIEWS.iso[0], pitch: VIEWS.iso[1], zoom: 1 });

  /** Directions of the picture in the printer's space; `back` points at the viewer. */
  function basis(camera) {
    const [cy, sy] = [Math.cos(camera.yaw), Math.sin(camera.yaw)];
    const [cp, sp] = [Math.cos(camera.pitch), Math.sin(camera.pitch)];
    return {
      right: [cy, sy, 0],
      up: [-sy * sp, cy * sp, cp],
      back: [sy * cp, -cy * cp, sp],
    };
  }

  const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];

  /** Pixels right of and below the middle of a picture, and mm towards the viewer. */
  function project(camera, axes, point) {
    const from = point.map((v, k) => v - camera.target[k]);
    return [
      dot(from, axes.right) * camera.zoom,
      -dot(from, axes.up) * camera.zoom,
      dot(from, axes.back),
    ];
  }

  function orbit(camera, dx, dy) {
    camera.yaw -= dx * 0.008;
    camera.pitch = Math.min(RIGHT_ANGLE, Math.max(-RIGHT_ANGLE, camera.pitch + dy * 0.008));
  }

  function pan(camera, dx, dy) {
    const { right, up } = basis(camera);
    camera.target = camera.target.map(
      (v, k) => v + (-dx * right[k] + dy * up[k]) / camera.zoom);
  }

  /** Zoom so that the point (x, y) px from the middle stays where it is. */
  function zoomAt(camera, factor, x, y) {
    const zoom = Math.min(400, Math.max(0.05, camera.zoom * factor));
    pan(camera, -x, -y);
    camera.zoom = zoom;
    pan(camera, x, y);
  }

  function turnTo(camera, name) {
    [camera.yaw, camera.pitch] = VIEWS[name];
  }

  /** Show a box whole in a picture of `width` x `height` px. */
  function fit(camera, low, high, width, height) {
    const axes = basis(camera);
    camera.target = low.map((v, k) => (v + high[k]) / 2);
    const half = low.map((v, k) => (high[k] - v) / 2);
    const reach = (axis) => axis.reduce((sum, v, k) => sum + Math.abs(v) * half[k], 0);
    const across = Math.max(reach(axes.right), 1);
    const upward = Math.max(reach(axes.up), 1);
    camera.zoom = Math.min((0.46 * width) / across, (0.43 * height) / upward);
  }

  D.camera = { make, basis, project, orbit, pan, zoomAt, turnTo, fit, dot };
})();
