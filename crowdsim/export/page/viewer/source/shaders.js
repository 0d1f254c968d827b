// Materials of everything that is drawn. Colors are plain sRGB, lit by a sky, a warm floor and a sun.

import * as THREE from "three";

export const theme = {
  night: { value: 0 },
};

const LIGHT = /* glsl */ `
  uniform float night;
  vec3 lit(vec3 color, vec3 n) {
    float sun = max(dot(n, normalize(vec3(-0.45, -0.6, 0.85))), 0.0);
    float fill = max(dot(n, normalize(vec3(0.7, 0.5, 0.35))), 0.0);
    vec3 sky = mix(vec3(0.62, 0.585, 0.56), vec3(0.70, 0.715, 0.74), 0.5 + 0.5 * n.z);
    vec3 light = sky + 0.33 * sun * vec3(1.0, 0.97, 0.9) + 0.08 * fill;
    return color * light * mix(1.0, 0.82, night);
  }
`;

const BONES = /* glsl */ `
  uniform highp sampler2D joints;
  uniform int perLine;
  uniform int texels;
  void bone(int row, float joint, out vec4 a, out vec4 b, out vec4 c) {
    ivec2 at = ivec2((row % perLine) * texels + 3 * int(joint), row / perLine);
    a = texelFetch(joints, at, 0);
    b = texelFetch(joints, at + ivec2(1, 0), 0);
    c = texelFetch(joints, at + ivec2(2, 0), 0);
  }
`;

const BODY_VERTEX = /* glsl */ `
  in vec3 place1; in float joint0; in float joint1; in float weight; in float tissue;
  in vec3 normal1; in float fullness;
  in float row; in float agent; in vec3 shirt; in vec2 build;
  #ifdef FAR
  in vec3 track;
  #endif
  flat out float vAgent; flat out vec3 vShirt; out float vTissue; out vec3 vNormal;
  ${BONES}
  void main() {
    vec4 a, b, c;
    bone(int(row), joint0, a, b, c);
    vec4 p = vec4(position, 1.0);
    vec3 world = vec3(dot(a, p), dot(b, p), dot(c, p));
    vec3 n = vec3(dot(a.xyz, normal), dot(b.xyz, normal), dot(c.xyz, normal));
    #ifndef FAR
    if (weight < 1.0) {
      bone(int(row), joint1, a, b, c);
      p = vec4(place1, 1.0);
      world = mix(vec3(dot(a, p), dot(b, p), dot(c, p)), world, weight);
      n = mix(vec3(dot(a.xyz, normal1), dot(b.xyz, normal1), dot(c.xyz, normal1)), n, weight);
    }
    #else
    float cosine = cos(track.z), sine = sin(track.z);
    world = vec3(cosine * world.x - sine * world.y + track.x, sine * world.x + cosine * world.y + track.y, world.z);
    n = vec3(cosine * n.x - sine * n.y, sine * n.x + cosine * n.y, n.z);
    #endif
    // A girth moves skin outward; a stature stretches the body upward from the floor, where feet stay planted.
    world = (world + build.y * fullness * normalize(n)) * vec3(1.0, 1.0, build.x);
    vAgent = agent;
    vShirt = shirt;
    vTissue = tissue;
    vNormal = n;
    gl_Position = projectionMatrix * viewMatrix * vec4(world, 1.0);
  }
`;

const BODY_FRAGMENT = /* glsl */ `
  flat in float vAgent; flat in vec3 vShirt; in float vTissue; in vec3 vNormal;
  uniform highp sampler2D looks;
  uniform float chosen;
  out vec4 pixel;
  ${LIGHT}
  void main() {
    // What a vertex shows is looked up here, so that shirts end in a line and do not fade into trousers.
    int who = int(vAgent), wide = textureSize(looks, 0).x / 5, tissue = int(vTissue + 0.5);
    vec3 color = tissue == 0 ? vShirt : texelFetch(looks, ivec2((who % wide) * 5 + tissue, who / wide), 0).rgb;
    if (vAgent == chosen) color = mix(color, vec3(1.0), 0.18);
    pixel = vec4(lit(color, normalize(vNormal)), 1.0);
  }
`;

const SHADOW_VERTEX = /* glsl */ `
  in float joint; in float size; in float dark; in float row;
  #ifdef FAR
  in vec3 track;
  #endif
  out vec2 vAt; out float vDark;
  ${BONES}
  void main() {
    vec4 a, b, c;
    bone(int(row), joint, a, b, c);
    vec2 center = vec2(a.w, b.w);
    #ifdef FAR
    center = vec2(cos(track.z) * center.x - sin(track.z) * center.y, sin(track.z) * center.x + cos(track.z) * center.y)
      + track.xy;
    #endif
    float lift = joint == 0.0 ? 0.0 : clamp(c.w - 0.08, 0.0, 0.3);
    vAt = position.xy;
    vDark = dark * (1.0 - 2.2 * lift);
    gl_Position = projectionMatrix * viewMatrix * vec4(center + size * (1.0 + lift) * position.xy, 0.0, 1.0);
  }
`;

const SHADOW_FRAGMENT = /* glsl */ `
  in vec2 vAt; in float vDark;
  out vec4 pixel;
  void main() {
    float far = length(vAt);
    float soft = 1.0 - smoothstep(0.0, 1.0, far);
    pixel = vec4(0.16, 0.13, 0.10, vDark * soft);
  }
`;

const onFloor = {
  depthTest: false, depthWrite: false, blending: THREE.CustomBlending,
  blendSrc: THREE.SrcAlphaFactor, blendDst: THREE.OneMinusSrcAlphaFactor,
  // The picture itself stays opaque, or the page would shine through.
  blendSrcAlpha: THREE.ZeroFactor, blendDstAlpha: THREE.OneFactor,
};

function material(options) {
  const made = new THREE.ShaderMaterial({ glslVersion: THREE.GLSL3, ...options });
  made.uniforms.night = theme.night;
  return made;
}

export function bodyMaterial(uniforms, far) {
  return material({
    vertexShader: BODY_VERTEX, fragmentShader: BODY_FRAGMENT, uniforms, defines: far ? { FAR: 1 } : {},
  });
}

export function shadowMaterial(uniforms, far) {
  return material({
    vertexShader: SHADOW_VERTEX, fragmentShader: SHADOW_FRAGMENT, uniforms, defines: far ? { FAR: 1 } : {}, ...onFloor,
  });
}

/** Flat faces of one color; `moving` ones are there for a span of steps, `glass` ones let through what is behind. */
export function faceMaterial(day, dark, { moving = false, glass = 0 } = {}) {
  return material({
    uniforms: {
      day: { value: new THREE.Color().setRGB(...day) }, dark: { value: new THREE.Color().setRGB(...dark) },
      step: { value: 0 }, opacity: { value: glass || 1 },
    },
    defines: moving ? { MOVING: 1 } : {},
    vertexShader: /* glsl */ `
      #ifdef MOVING
      in vec2 span; uniform float step;
      #endif
      out vec3 vWorld;
      void main() {
        vWorld = position;
        vec3 p = position;
        #ifdef MOVING
        if (step < span.x || step >= span.y) p = vec3(0.0, 0.0, -1e6);
        #endif
        gl_Position = projectionMatrix * viewMatrix * vec4(p, 1.0);
      }`,
    fragmentShader: /* glsl */ `
      in vec3 vWorld; out vec4 pixel;
      uniform vec3 day; uniform vec3 dark; uniform float opacity;
      ${LIGHT}
      void main() {
        vec3 n = normalize(cross(dFdx(vWorld), dFdy(vWorld)));
        vec3 color = lit(mix(day, dark, night), n);
        // A little darker towards the floor, as in corners.
        color *= mix(1.0, mix(0.86, 1.0, smoothstep(0.0, 0.6, vWorld.z)), 1.0 - abs(n.z));
        pixel = vec4(color, opacity);
      }`,
    transparent: glass > 0, depthWrite: glass === 0, side: glass > 0 ? THREE.FrontSide : THREE.DoubleSide,
  });
}

/** What lies on the floor and is not lit: colors with opacity at each corner. */
export function floorMaterial(texture = null) {
  return material({
    uniforms: { picture: { value: texture }, nightly: { value: 1 } },
    defines: texture ? { PICTURE: 1 } : {},
    vertexShader: /* glsl */ `
      in vec4 tint; out vec4 vTint; out vec2 vUv;
      void main() { vTint = tint; vUv = uv; gl_Position = projectionMatrix * viewMatrix * vec4(position, 1.0); }`,
    fragmentShader: /* glsl */ `
      in vec4 vTint; in vec2 vUv; out vec4 pixel;
      uniform sampler2D picture; uniform float night; uniform float nightly;
      void main() {
        #ifdef PICTURE
        pixel = texture(picture, vUv);
        #else
        pixel = vTint;
        pixel.rgb *= mix(1.0, nightly, night);
        #endif
      }`,
    side: THREE.DoubleSide, ...onFloor,
  });
}

/** Thin lines of one color. */
export function lineMaterial(day, dark, { moving = false, floor = false, opacity = 1 } = {}) {
  return material({
    uniforms: {
      day: { value: new THREE.Color().setRGB(...day) }, dark: { value: new THREE.Color().setRGB(...dark) },
      step: { value: 0 }, opacity: { value: opacity },
    },
    defines: moving ? { MOVING: 1 } : {},
    vertexShader: /* glsl */ `
      #ifdef MOVING
      in vec2 span; uniform float step;
      #endif
      void main() {
        vec3 p = position;
        #ifdef MOVING
        if (step < span.x || step >= span.y) p = vec3(0.0, 0.0, -1e6);
        #endif
        gl_Position = projectionMatrix * viewMatrix * vec4(p, 1.0);
      }`,
    fragmentShader: /* glsl */ `
      out vec4 pixel; uniform vec3 day; uniform vec3 dark; uniform float night; uniform float opacity;
      void main() { pixel = vec4(mix(day, dark, night), opacity); }`,
    ...(floor ? onFloor : { transparent: opacity < 1 }),
  });
}
