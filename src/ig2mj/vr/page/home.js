// The home as three.js draws it: geometry once, then poses of bodies, particles and tints of objects.
//
// The home's axes are x forward, y left, z up; WebXR's are x right, y up, z backwards. `home.root` turns one into the
// other and puts the play area where it is, so that cameras and hands stay as the device says.
import * as THREE from "three";
import {GLTFLoader} from "three/addons/loaders/GLTFLoader.js";

const XR_FROM_HOME = new THREE.Matrix4().set(0, -1, 0, 0, 0, 0, 1, 0, -1, 0, 0, 0, 0, 0, 0, 1);
export const HOME_FROM_XR = XR_FROM_HOME.clone().invert();
const GLIDE = 0.03; // s in which the play area follows what the server says
const MOST_MARKS = 4096;

export class Home {
  constructor(welcome) {
    this.root = new THREE.Group();
    this.root.matrixAutoUpdate = false;
    this.area = {x: 0, y: 0, z: 0, yaw: 0};
    this.wanted = null;
    this.tints = welcome.tints;
    this.welcome = welcome;
    this.bodies = [];
    this.ofObject = new Map();
    this.shown = [];
    this.ghosts = [];
    this.marks = [new THREE.SphereGeometry(1, 8, 6), new THREE.BoxGeometry(2, 2, 2)].map((shape) => {
      const mesh = new THREE.InstancedMesh(shape, new THREE.MeshLambertMaterial(), MOST_MARKS);
      mesh.count = 0;
      mesh.frustumCulled = false;
      this.root.add(mesh);
      return mesh;
    });
  }

  async load(url) {
    const file = await new GLTFLoader().loadAsync(url);
    for (let b = 0; b < this.welcome.bodies; b++) {
      const body = file.scene.getObjectByName(`body_${b}`);
      this.bodies.push(body);
      this.root.add(body);
      body.traverse((node) => {
        const owner = node.userData.object;
        if (owner === undefined || owner < 0) return;
        if (!this.ofObject.has(owner)) this.ofObject.set(owner, []);
        node.traverse((part) => { if (part.isMesh) this.ofObject.get(owner).push({part, own: part.material, tint: -1}); });
      });
    }
    this.bodies[this.welcome.own].visible = false; // nobody sees their own head from inside
  }

  // Poses of bodies: Float32Array of messages.py's `pose_message`.
  pose(message) {
    const count = message[0];
    this.wanted = {x: message[1], y: message[2], z: message[3], yaw: message[4]};
    for (let k = 0, at = 13; k < count; k++, at += 8) {
      const body = this.bodies[message[at]];
      if (!body) continue;
      body.position.set(message[at + 1], message[at + 2], message[at + 3]);
      body.quaternion.set(message[at + 5], message[at + 6], message[at + 7], message[at + 4]);
    }
    if (count === this.bodies.length && this.ghosts.length === 0) this.makeGhosts();
  }

  // Glides to where the play area shall be; called for every picture.
  advance(seconds) {
    if (!this.wanted) return;
    const area = this.area, wanted = this.wanted;
    const far = Math.hypot(wanted.x - area.x, wanted.y - area.y, wanted.z - area.z) > 0.3 || Math.abs(wanted.yaw - area.yaw) > 0.1;
    const share = far ? 1 : 1 - Math.exp(-seconds / GLIDE);
    for (const name of ["x", "y", "z", "yaw"]) area[name] += (wanted[name] - area[name]) * share;
    const place = new THREE.Matrix4().makeRotationZ(area.yaw).setPosition(area.x, area.y, area.z);
    this.root.matrix.copy(XR_FROM_HOME).multiply(place.invert());
    this.root.matrixWorldNeedsUpdate = true;
  }

  looks(message) {
    const counts = [0, 0], place = new THREE.Matrix4(), colour = new THREE.Color();
    for (const m of message.marks.slice(0, MOST_MARKS)) {
      const mesh = this.marks[m[0]], k = counts[m[0]]++;
      place.compose(new THREE.Vector3(m[4], m[5], m[6]), new THREE.Quaternion(m[8], m[9], m[10], m[7]), new THREE.Vector3(m[1], m[2], m[3]));
      mesh.setMatrixAt(k, place);
      mesh.setColorAt(k, colour.setRGB(m[11], m[12], m[13], THREE.SRGBColorSpace));
    }
    this.marks.forEach((mesh, k) => {
      mesh.count = counts[k];
      mesh.instanceMatrix.needsUpdate = true;
      if (mesh.instanceColor) mesh.instanceColor.needsUpdate = true;
    });
    message.tint.forEach((tint, object) => {
      for (const entry of this.ofObject.get(object) ?? []) if (entry.tint !== tint) this.paint(entry, tint);
    });
  }

  paint(entry, tint) {
    entry.tint = tint;
    if (entry.part.material !== entry.own) entry.part.material.dispose();
    entry.part.material = entry.own;
    if (tint < 0) return;
    const {weight, colour, brightness} = this.tints[tint], look = entry.own.clone();
    look.color.lerp(new THREE.Color().setRGB(...colour, THREE.SRGBColorSpace), weight).multiplyScalar(brightness);
    entry.part.material = look;
  }

  // Hands where the devices are, seen while the robot's own cannot follow.
  makeGhosts() {
    const look = new THREE.MeshLambertMaterial({color: 0x9fd0ff, transparent: true, opacity: 0.35, depthWrite: false});
    for (const hand of this.welcome.hands) {
      const palm = this.bodies[hand.palm], ghost = new THREE.Group();
      const into = new THREE.Matrix4().compose(palm.position, palm.quaternion, palm.scale).invert();
      for (const b of hand.bodies) {
        const body = this.bodies[b], copy = body.clone(true);
        copy.applyMatrix4(into);
        copy.traverse((node) => { if (node.isMesh) node.material = look; });
        ghost.add(copy);
      }
      const [x, y, z, qw, qx, qy, qz] = hand.in_grip;
      // The hand in the grip, both in the home's axes.
      ghost.userData.inGrip = new THREE.Matrix4().compose(new THREE.Vector3(x, y, z), new THREE.Quaternion(qx, qy, qz, qw), new THREE.Vector3(1, 1, 1));
      ghost.userData.palm = palm;
      ghost.matrixAutoUpdate = false;
      ghost.visible = false;
      this.ghosts.push(ghost);
    }
  }

  // `grip`: matrix of a hand's grip in XR's axes, or null.
  showGhost(hand, grip) {
    const ghost = this.ghosts[hand];
    if (!ghost) return;
    ghost.visible = false;
    if (!grip) return;
    // in_grip belongs to an untilted grip: its rotation is of XR's axes into the home's, so it follows the grip as it is.
    ghost.matrix.copy(grip).multiply(XR_FROM_HOME).multiply(ghost.userData.inGrip);
    ghost.matrixWorldNeedsUpdate = true;
    const here = new THREE.Vector3().setFromMatrixPosition(ghost.matrix);
    const there = ghost.userData.palm.getWorldPosition(new THREE.Vector3());
    ghost.visible = here.distanceTo(there) > 0.15;
  }
}
