"""What the ROS tests share: the latest message of a topic, and waiting for it with a limit."""
import threading
import time

import rospy

LIMIT = 60.0  # s of wall time; generous, for loaded machines: a test that passes does not wait for it


class Latest:
    """Subscribes to a topic and keeps its latest message."""

    def __init__(self, topic, kind):
        self.topic = topic
        self.count = 0
        self.message = None
        self.changed = threading.Condition()
        self.subscriber = rospy.Subscriber(topic, kind, self.receive, queue_size=100)

    def receive(self, message):
        with self.changed:
            self.message = message
            self.count += 1
            self.changed.notify_all()

    def wait(self, condition=lambda message: True, what="a message", limit=LIMIT):
        """The next message that fulfils the condition; fails when none came within the limit."""
        end = time.monotonic() + limit
        with self.changed:
            seen = self.count
            while True:
                if self.count > seen and condition(self.message):
                    return self.message
                seen = self.count
                left = end - time.monotonic()
                if left <= 0 or rospy.is_shutdown():
                    raise AssertionError("waited %g s in vain for %s on %s; the last was:\n%s"
                                         % (limit, what, self.topic, str(self.message)[:2000]))
                self.changed.wait(left)

    def close(self):
        self.subscriber.unregister()


class Log(Latest):
    """Warnings and errors the node writes to rosout."""

    def __init__(self):
        from rosgraph_msgs.msg import Log as LogMessage
        self.texts = []
        super().__init__("/rosout", LogMessage)  # not rosout_agg: rostest starts no aggregator
        end = time.monotonic() + LIMIT
        while self.subscriber.get_num_connections() < 2 and time.monotonic() < end:  # the node and this test
            time.sleep(0.02)

    def receive(self, message):
        if "sph_muscle" in message.name:
            with self.changed:
                self.texts.append(message.msg)
        super().receive(message)

    def wait_for_text(self, *parts):
        def found():
            return [text for text in self.texts if all(part in text for part in parts)]
        end = time.monotonic() + LIMIT
        with self.changed:
            while not found():
                left = end - time.monotonic()
                if left <= 0:
                    raise AssertionError("no log line with %s; there were:\n%s" % (parts, "\n".join(self.texts)))
                self.changed.wait(left)
            return found()[0]


def publisher(topic, kind):
    """A publisher somebody listens to: what is published next arrives."""
    made = rospy.Publisher(topic, kind, queue_size=10)
    end = time.monotonic() + LIMIT
    while made.get_num_connections() == 0:
        if time.monotonic() > end:
            raise AssertionError("nobody listens to %s" % topic)
        time.sleep(0.02)
    return made


def service(name, kind):
    rospy.wait_for_service(name, LIMIT)
    return rospy.ServiceProxy(name, kind)
