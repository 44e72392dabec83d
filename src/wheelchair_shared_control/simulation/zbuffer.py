"""Depth of boxes and triangles on a floor by a z-buffer: a visible face is a plane, whose inverse depth is affine
in the pixel's row and column, so that a row of pixels is one multiply-add each."""
import numpy as np
from numba import njit

NEAR = 0.05  # m: what is nearer to the camera's plane is cut off
_RAYS_PER_PIXEL = 2.0  # of the level fan that finds out which boxes hide behind walls
_EDGE = 1e-3  # pixels by which faces overlap, so that no crack opens between two that share an edge

_WORTH_CULLING = 40  # boxes

# Corners of a unit box, and its faces as corners in order round the face, with outward normals.
_CORNERS = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
_FACES = np.array([[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]])
_NORMALS = np.array([[-1.0, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]])


def render(boxes, camera, world_from_camera, max_depth=np.inf, floor=True, out=None):
    """Inverse depth [1/m] and the distance [m] of the plane seen, each (height, width) float32.

    ``boxes`` (n, 7) as in ``World``; ``world_from_camera`` (4, 4) of the optical frame. Inverse depth is 0
    where nothing is seen; what lies beyond ``max_depth`` may be left out. The cosine of incidence at a pixel
    with ray d = (x, y, 1) is inverse depth * plane distance / abs(d).
    """
    shape = (camera.height, camera.width)
    inverse, plane = out if out is not None else (np.empty(shape, np.float32), np.empty(shape, np.float32))
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    boxes = np.ascontiguousarray(boxes, dtype=np.float64)
    pose = np.ascontiguousarray(world_from_camera, dtype=np.float64)
    limit = min(float(max_depth), 1e6)
    if len(boxes) > _WORTH_CULLING:
        boxes = boxes[_in_sight(boxes, lens, inverse.shape, pose, limit)]
    _render(boxes, lens, pose, limit, floor, inverse, plane, _CORNERS, _FACES, _NORMALS)
    return inverse, plane


def render_triangles(triangles, camera, world_from_camera, max_depth, out):
    """Draw triangles (n, 3, 3) [m] of the world, seen from either side, into what ``render`` returned."""
    inverse, plane = out
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy])
    _render_triangles(triangles, lens, np.ascontiguousarray(world_from_camera, dtype=np.float64),
                      min(float(max_depth), 1e6), inverse, plane)


def render_boxes(boxes, camera, world_from_camera, floor=True):
    """Depth image (height, width) float32 [m] without noise; +Inf where nothing is seen."""
    inverse, _ = render(boxes, camera, world_from_camera, floor=floor)
    with np.errstate(divide="ignore"):
        return np.float32(1.0) / inverse


@njit(cache=True, nogil=True)
def _render(boxes, lens, pose, max_depth, floor, inverse, plane, unit, faces, normals):
    height, width = inverse.shape
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    _fill_floor(inverse, plane, lens, pose, floor)
    # The frustum's side planes, as unit normals pointing in.
    left, right = cx / fx, (width - 1 - cx) / fx
    top, bottom = cy / fy, (height - 1 - cy) / fy
    corner = np.empty((8, 3))
    polygon, clipped = np.empty((4, 3)), np.empty((8, 3))
    pixels = np.empty((8, 2))
    low, high = np.empty(height), np.empty(height)
    for b in range(len(boxes)):
        hx, hy, hz = boxes[b, 4], boxes[b, 5], boxes[b, 6]
        dx, dy, dz = boxes[b, 0] - pose[0, 3], boxes[b, 1] - pose[1, 3], boxes[b, 2] - pose[2, 3]
        radius = np.sqrt(hx * hx + hy * hy + hz * hz)
        x = pose[0, 0] * dx + pose[1, 0] * dy + pose[2, 0] * dz
        y = pose[0, 1] * dx + pose[1, 1] * dy + pose[2, 1] * dz
        z = pose[0, 2] * dx + pose[1, 2] * dy + pose[2, 2] * dz
        if z + radius < NEAR or z - radius > max_depth:
            continue
        if x + left * z < -radius * np.sqrt(1.0 + left * left):
            continue
        if -x + right * z < -radius * np.sqrt(1.0 + right * right):
            continue
        if y + top * z < -radius * np.sqrt(1.0 + top * top):
            continue
        if -y + bottom * z < -radius * np.sqrt(1.0 + bottom * bottom):
            continue
        c, s = np.cos(boxes[b, 3]), np.sin(boxes[b, 3])
        # the camera's centre in the box's own frame tells which faces look at it
        ox, oy, oz = -(c * dx + s * dy), -(-s * dx + c * dy), -dz
        for k in range(8):
            ux, uy, uz = unit[k, 0] * hx, unit[k, 1] * hy, unit[k, 2] * hz
            wx, wy, wz = dx + c * ux - s * uy, dy + s * ux + c * uy, dz + uz
            for a in range(3):
                corner[k, a] = pose[0, a] * wx + pose[1, a] * wy + pose[2, a] * wz
        for f in range(6):
            nx, ny, nz = normals[f, 0], normals[f, 1], normals[f, 2]
            distance = nx * ox + ny * oy + nz * oz - (abs(nx) * hx + abs(ny) * hy + abs(nz) * hz)
            if distance <= 1e-9:
                continue
            wx, wy, wz = c * nx - s * ny, s * nx + c * ny, nz
            for k in range(4):
                for a in range(3):
                    polygon[k, a] = corner[faces[f, k], a]
            count = _clip_near(polygon, 4, clipped)
            if count < 3:
                continue
            # outward normal in the camera's frame; the plane is normal . p = -distance
            mx = pose[0, 0] * wx + pose[1, 0] * wy + pose[2, 0] * wz
            my = pose[0, 1] * wx + pose[1, 1] * wy + pose[2, 1] * wz
            mz = pose[0, 2] * wx + pose[1, 2] * wy + pose[2, 2] * wz
            _fill_face(clipped, count, mx, my, mz, distance, lens, pixels, low, high, inverse, plane)


@njit(cache=True, nogil=True)
def _render_triangles(triangles, lens, pose, max_depth, inverse, plane):
    height, width = inverse.shape
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    left, right = -(cx + 1.0) / fx, (width - cx) / fx
    top, bottom = -(cy + 1.0) / fy, (height - cy) / fy
    polygon, clipped = np.empty((3, 3)), np.empty((8, 3))
    pixels = np.empty((8, 2))
    low, high = np.empty(height), np.empty(height)
    for t in range(len(triangles)):
        nearest, farthest = 1e300, -1e300
        outside = 15  # a bit for each side of the view that all corners are beyond
        for k in range(3):
            dx, dy = triangles[t, k, 0] - pose[0, 3], triangles[t, k, 1] - pose[1, 3]
            dz = triangles[t, k, 2] - pose[2, 3]
            for a in range(3):
                polygon[k, a] = pose[0, a] * dx + pose[1, a] * dy + pose[2, a] * dz
            x, y, z = polygon[k, 0], polygon[k, 1], polygon[k, 2]
            nearest, farthest = min(nearest, z), max(farthest, z)
            if x >= left * z:
                outside &= ~1
            if x <= right * z:
                outside &= ~2
            if y >= top * z:
                outside &= ~4
            if y <= bottom * z:
                outside &= ~8
        if farthest < NEAR or nearest > max_depth or outside:
            continue
        ax, ay, az = polygon[1, 0] - polygon[0, 0], polygon[1, 1] - polygon[0, 1], polygon[1, 2] - polygon[0, 2]
        bx, by, bz = polygon[2, 0] - polygon[0, 0], polygon[2, 1] - polygon[0, 1], polygon[2, 2] - polygon[0, 2]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        if length < 1e-12:
            continue
        nx, ny, nz = nx / length, ny / length, nz / length
        distance = -(nx * polygon[0, 0] + ny * polygon[0, 1] + nz * polygon[0, 2])
        if distance < 0.0:
            nx, ny, nz, distance = -nx, -ny, -nz, -distance
        if distance < 1e-6:
            continue  # seen edge on
        count = _clip_near(polygon, 3, clipped)
        if count >= 3:
            _fill_face(clipped, count, nx, ny, nz, distance, lens, pixels, low, high, inverse, plane)


@njit(cache=True, nogil=True)
def _in_sight(boxes, lens, shape, pose, max_depth):
    """Which boxes (n,) bool are not wholly behind walls that reach from the floor to above the view.

    A map's wall is hundreds of boxes, one behind the other. A level fan of rays, finer than the pixels, finds
    the nearest wall in each direction; a box nearer than that in no direction of its own is not drawn.
    """
    n = len(boxes)
    seen = np.ones(n, np.bool_)
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    ahead = np.hypot(pose[0, 2], pose[1, 2])
    if ahead < 0.5:
        return seen  # looks up or down: no level fan
    ex, ey = pose[0, 2] / ahead, pose[1, 2] / ahead
    # the view's widest and highest directions are those of its corners
    widest, highest = 0.0, 0.0
    for u in (0.0, shape[1] - 1.0):
        for v in (0.0, shape[0] - 1.0):
            x, y = (u - cx) / fx, (v - cy) / fy
            dx = pose[0, 0] * x + pose[0, 1] * y + pose[0, 2]
            dy = pose[1, 0] * x + pose[1, 1] * y + pose[1, 2]
            dz = pose[2, 0] * x + pose[2, 1] * y + pose[2, 2]
            forward, left = ex * dx + ey * dy, -ey * dx + ex * dy
            if forward < 0.2:
                return seen
            widest = max(widest, abs(left / forward))
            highest = max(highest, dz / np.hypot(dx, dy))
    widest += 0.02
    count = int(np.ceil(2.0 * widest * fx * _RAYS_PER_PIXEL)) + 1
    per = (count - 1) / (2.0 * widest)
    nearest = np.zeros(count)  # inverse distance ahead
    reach = 1.5 * max_depth
    top = pose[2, 3] + max(0.0, highest) * min(reach, 100.0)
    low, high, close = np.empty(n), np.empty(n), np.empty(n)
    px, py = np.empty(4), np.empty(4)
    for b in range(n):
        c, s = np.cos(boxes[b, 3]), np.sin(boxes[b, 3])
        wx, wy = boxes[b, 0] - pose[0, 3], boxes[b, 1] - pose[1, 3]
        hx, hy = boxes[b, 4], boxes[b, 5]
        least, most = 1e300, -1e300
        low[b], high[b] = 1e300, -1e300
        for k in range(4):
            ux = hx if k == 0 or k == 3 else -hx
            uy = hy if k < 2 else -hy
            x, y = wx + c * ux - s * uy, wy + s * ux + c * uy
            px[k], py[k] = ex * x + ey * y, -ey * x + ex * y
            least, most = min(least, px[k]), max(most, px[k])
        close[b] = 1e300
        if least <= NEAR:
            seen[b] = most > NEAR
            continue  # beside or around the camera: neither hides nor is hidden
        for k in range(4):
            t = py[k] / px[k]
            low[b], high[b] = min(low[b], t), max(high[b], t)
        if low[b] > widest or high[b] < -widest or least > reach:
            seen[b] = False
            continue
        close[b] = 1.0 / least
        if boxes[b, 2] - boxes[b, 6] > 1e-6 or boxes[b, 2] + boxes[b, 6] < top:
            continue
        for k in range(4):
            j = (k + 1) % 4
            # corners go counter-clockwise: an edge faces the camera where it is passed the other way round
            if px[k] * py[j] - py[k] * px[j] >= 0.0:
                continue
            ta, tb = py[k] / px[k], py[j] / px[j]
            ia, ib = 1.0 / px[k], 1.0 / px[j]
            if ta > tb:
                ta, tb, ia, ib = tb, ta, ib, ia
            first = max(0, int(np.ceil((ta + widest) * per - 1e-9)))
            last = min(count - 1, int(np.floor((tb + widest) * per + 1e-9)))
            slope = (ib - ia) / (tb - ta) if tb > ta else 0.0
            for r in range(first, last + 1):
                nearest[r] = max(nearest[r], ia + slope * (r / per - widest - ta))
    for b in range(n):
        if not seen[b] or close[b] == 1e300:
            continue
        first = max(0, int(np.floor((low[b] + widest) * per)))
        last = min(count - 1, int(np.ceil((high[b] + widest) * per)))
        hidden = first <= last
        for r in range(first, last + 1):
            if nearest[r] <= close[b] * (1.0 + 1e-9):
                hidden = False
                break
        seen[b] = not hidden
    return seen


@njit(cache=True, nogil=True)
def _fill_floor(inverse, plane, lens, pose, floor):
    height, width = inverse.shape
    if not floor or pose[2, 3] <= 0.0:
        inverse[:] = 0.0
        plane[:] = 0.0
        return
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    scale = -1.0 / pose[2, 3]
    per_column = np.float32(scale * pose[2, 0] / fx)
    for v in range(height):
        first = np.float32(scale * (pose[2, 0] * (-cx / fx) + pose[2, 1] * ((v - cy) / fy) + pose[2, 2]))
        if per_column == 0.0:
            inverse[v, :] = max(first, np.float32(0.0))
        else:
            for u in range(width):
                inverse[v, u] = max(first + per_column * np.float32(u), np.float32(0.0))
    plane[:] = pose[2, 3]


@njit(cache=True, nogil=True)
def _clip_near(polygon, count, clipped):
    """Cut a polygon (k, 3) at z = NEAR; returns the number of points kept in ``clipped``."""
    kept = 0
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        za, zb = polygon[i, 2] - NEAR, polygon[j, 2] - NEAR
        if za >= 0.0:
            for a in range(3):
                clipped[kept, a] = polygon[i, a]
            kept += 1
        if (za >= 0.0) != (zb >= 0.0):
            t = za / (za - zb)
            for a in range(3):
                clipped[kept, a] = polygon[i, a] + t * (polygon[j, a] - polygon[i, a])
            kept += 1
    return kept


@njit(cache=True, nogil=True, fastmath=True)
def _fill_face(clipped, count, nx, ny, nz, distance, lens, pixels, low, high, inverse, plane):
    """Draw a convex polygon of the plane ``n . p = -distance`` (camera frame) where it is nearest."""
    height, width = inverse.shape
    fx, fy, cx, cy = lens[0], lens[1], lens[2], lens[3]
    top, bottom = 1e300, -1e300
    for i in range(count):
        pixels[i, 0] = fx * clipped[i, 0] / clipped[i, 2] + cx
        pixels[i, 1] = fy * clipped[i, 1] / clipped[i, 2] + cy
        top, bottom = min(top, pixels[i, 1]), max(bottom, pixels[i, 1])
    first = max(0, int(np.ceil(max(top, -1.0) - _EDGE)))
    last = min(height - 1, int(np.floor(min(bottom, height + 1.0) + _EDGE)))
    if first > last:
        return
    for v in range(first, last + 1):
        low[v], high[v] = 1e300, -1e300
    for i in range(count):
        j = i + 1 if i + 1 < count else 0
        xa, ya, xb, yb = pixels[i, 0], pixels[i, 1], pixels[j, 0], pixels[j, 1]
        if ya > yb:
            xa, ya, xb, yb = xb, yb, xa, ya
        begin = max(first, int(np.ceil(max(ya, -1.0) - _EDGE)))
        end = min(last, int(np.floor(min(yb, height + 1.0) + _EDGE)))
        slope = (xb - xa) / (yb - ya) if yb - ya > 1e-9 else 0.0
        for v in range(begin, end + 1):
            if yb - ya > 1e-9:
                x = xa + slope * min(max(v - ya, 0.0), yb - ya)
                low[v], high[v] = min(low[v], x), max(high[v], x)
            else:
                low[v], high[v] = min(low[v], min(xa, xb)), max(high[v], max(xa, xb))
    scale = -1.0 / distance
    per_column = np.float32(scale * nx / fx)
    face = np.float32(distance)
    for v in range(first, last + 1):
        begin = int(np.ceil(max(low[v], -1.0) - _EDGE))
        end = int(np.floor(min(high[v], width + 1.0) + _EDGE))
        begin, end = max(begin, 0), min(end, width - 1)
        if begin > end:
            continue
        value = scale * (nx * ((begin - cx) / fx) + ny * ((v - cy) / fy) + nz)
        start = np.float32(value)
        row, row_plane = inverse[v], plane[v]
        for k in range(end - begin + 1):
            new = start + per_column * np.float32(k)
            old = row[begin + k]
            nearer = new > old
            row[begin + k] = new if nearer else old
            row_plane[begin + k] = face if nearer else row_plane[begin + k]
